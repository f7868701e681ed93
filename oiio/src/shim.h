// The C face of OpenImageIO that this crate calls. Only plain data crosses it; no function lets an exception out.
//
// Functions that can fail return 0 on success and 1 on failure, and then put a message into `error`. Handles are owned
// by the caller, who gives them back exactly once.
#pragma once
#include <cstddef>
#include <cstdint>

extern "C" {

typedef struct { char text[1024]; } shim_error;

// Values are fixed: the Rust side repeats them.
enum shim_format { SHIM_U8 = 0, SHIM_U16 = 1, SHIM_HALF = 2, SHIM_FLOAT = 3 };
enum shim_kind { SHIM_STRING = 0, SHIM_INT = 1, SHIM_FLOATS = 2, SHIM_MATRIX = 3, SHIM_RATIONAL = 4 };

typedef struct {
    int32_t x, y, width, height;                     // data window
    int32_t full_x, full_y, full_width, full_height; // display window
    int32_t channels, format, attributes;
} shim_info;

// `data` lives as long as the reader. `count` is in elements: bytes, int32, float.
typedef struct {
    const char* name;
    const void* data;
    size_t count;
    int32_t kind;
} shim_attribute;

typedef struct {
    float s, t, dsdx, dtdx, dsdy, dtdy;
    int32_t channels, wrap, interpolation, mip, anisotropy;
} shim_lookup;

typedef struct shim_reader shim_reader;
typedef struct shim_writer shim_writer;
typedef struct shim_textures shim_textures;

const char* shim_version(void) noexcept;
int shim_set_threads(int threads, shim_error* error) noexcept;

int shim_reader_open(const char* path, shim_reader** reader, shim_info* info, shim_error* error) noexcept;
const char* shim_reader_channel(const shim_reader* reader, int index) noexcept;
void shim_reader_attribute(const shim_reader* reader, int index, shim_attribute* attribute) noexcept;
int shim_reader_read(shim_reader* reader, int format, void* pixels, shim_error* error) noexcept;
void shim_reader_close(shim_reader* reader) noexcept;

int shim_writer_create(const char* format, const shim_info* windows, shim_writer** writer,
                            shim_error* error) noexcept;
int shim_writer_channel(shim_writer* writer, const char* name, int format, shim_error* error) noexcept;
int shim_writer_attribute(shim_writer* writer, const shim_attribute* attribute, shim_error* error) noexcept;
int shim_writer_write(shim_writer* writer, const char* path, const float* pixels, shim_error* error) noexcept;
void shim_writer_destroy(shim_writer* writer) noexcept;

int shim_textures_create(float megabytes, int max_open_files, int tile, shim_textures** textures,
                              shim_error* error) noexcept;
int shim_textures_open(shim_textures* textures, const char* path, void** texture, shim_info* info,
                            shim_error* error) noexcept;
void* shim_textures_thread(shim_textures* textures) noexcept;
void shim_textures_thread_end(shim_textures* textures, void* thread) noexcept;
int shim_textures_sample(shim_textures* textures, void* thread, void* texture, const shim_lookup* lookup,
                              float* result) noexcept;
void shim_textures_last_error(shim_textures* textures, shim_error* error) noexcept;
int shim_textures_stats(shim_textures* textures, int64_t* memory_used, int64_t* tiles_read) noexcept;
void shim_textures_destroy(shim_textures* textures) noexcept;
}
