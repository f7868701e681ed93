#include "shim.h"

#include <OpenImageIO/imagecache.h>
#include <OpenImageIO/imageio.h>
#include <OpenImageIO/texture.h>

#include <cstring>
#include <exception>
#include <memory>
#include <string>
#include <vector>

using namespace OIIO;

// The Rust side asserts the same sizes.
static_assert(sizeof(shim_info) == 44 && sizeof(shim_lookup) == 44);
static_assert(sizeof(shim_attribute) == 3 * sizeof(size_t) + 8 && sizeof(shim_error) == 1024);

namespace {

void say(shim_error* error, const std::string& text) {
    size_t length = std::min(text.size(), sizeof(error->text) - 1);
    std::memcpy(error->text, text.data(), length);
    error->text[length] = 0;
}

struct Failure : std::exception {
    std::string text;
    explicit Failure(std::string t) : text(std::move(t)) {}
    const char* what() const noexcept override { return text.c_str(); }
};

// OpenImageIO can fail without a message.
[[noreturn]] void fail(const std::string& message) { throw Failure(message.empty() ? "unknown error" : message); }

// Runs `body`; an exception of any kind becomes a message.
template <typename Body> int guarded(shim_error* error, Body&& body) noexcept {
    try {
        body();
        return 0;
    } catch (const std::exception& e) {
        say(error, e.what());
    } catch (...) {
        say(error, "unknown exception");
    }
    return 1;
}

TypeDesc type_of(int format) {
    switch (format) {
    case SHIM_U8: return TypeDesc::UINT8;
    case SHIM_U16: return TypeDesc::UINT16;
    case SHIM_HALF: return TypeDesc::HALF;
    default: return TypeDesc::FLOAT;
    }
}

// The smallest of our four formats that holds every channel without loss (doubles and 32-bit integers aside).
int format_of(const ImageSpec& spec) {
    int format = SHIM_U8;
    for (int c = 0; c < spec.nchannels; ++c) {
        switch (spec.channelformat(c).basetype) {
        case TypeDesc::UINT8: break;
        case TypeDesc::UINT16: format = std::max(format, int(SHIM_U16)); break;
        case TypeDesc::HALF: format = format <= SHIM_U8 || format == SHIM_HALF ? SHIM_HALF : SHIM_FLOAT; break;
        default: format = SHIM_FLOAT;
        }
    }
    return format;
}

shim_info info_of(const ImageSpec& spec, int attributes) {
    return { spec.x,          spec.y,           spec.width,     spec.height,     spec.full_x, spec.full_y,
             spec.full_width, spec.full_height, spec.nchannels, format_of(spec), attributes };
}

// Puts a parameter of a spec into the form that crosses the border; false for types that do not.
bool describe(const ParamValue& value, shim_attribute& out) {
    TypeDesc type = value.type();
    size_t elements = type.numelements();
    out.name = value.name().c_str();
    out.data = value.data();
    out.count = elements;
    if (type == TypeDesc::STRING) {
        ustring text = value.get_ustring();
        out.data = text.c_str();
        out.count = text.size();
        out.kind = SHIM_STRING;
    } else if (type.basetype == TypeDesc::FLOAT && type.aggregate == TypeDesc::MATRIX44 && elements == 1) {
        out.count = 16;
        out.kind = SHIM_MATRIX;
    } else if (type == TypeRational) {
        out.count = 2;
        out.kind = SHIM_RATIONAL;
    } else if (type == TypeDesc::INT) {
        out.kind = SHIM_INT;
    } else if (type.basetype == TypeDesc::FLOAT) {
        out.count = elements * type.aggregate;
        out.kind = SHIM_FLOATS;
    } else {
        return false;
    }
    return true;
}

#if OIIO_VERSION_MAJOR >= 3
using TextureSystemPtr = std::shared_ptr<TextureSystem>;
TextureSystemPtr create_textures() { return TextureSystem::create(false); }
#else
struct DestroyTextures {
    void operator()(TextureSystem* system) const { TextureSystem::destroy(system, true); }
};
using TextureSystemPtr = std::unique_ptr<TextureSystem, DestroyTextures>;
TextureSystemPtr create_textures() { return TextureSystemPtr(TextureSystem::create(false)); }
#endif

} // namespace

struct shim_reader {
    std::unique_ptr<ImageInput> input;
    ImageSpec spec;
    std::vector<shim_attribute> attributes;
};

struct shim_writer {
    std::unique_ptr<ImageOutput> output;
    ImageSpec spec;
    bool mixed = false;
};

struct shim_textures {
    TextureSystemPtr system;
};

extern "C" {

const char* shim_version(void) noexcept { return OIIO_VERSION_STRING; }

int shim_set_threads(int threads, shim_error* error) noexcept {
    return guarded(error, [&] {
        // OpenEXR keeps a pool of its own beside OpenImageIO's. Its value for "in the calling thread, no pool" is -1.
        if (!attribute("threads", threads) || !attribute("exr_threads", threads == 1 ? -1 : threads)) fail(geterror());
    });
}

int shim_reader_open(const char* path, shim_reader** reader, shim_info* info, shim_error* error) noexcept {
    return guarded(error, [&] {
        auto r = std::make_unique<shim_reader>();
        // Texels as stored: a mask in the alpha channel must not darken the other channels.
        ImageSpec config;
        config["oiio:UnassociatedAlpha"] = 1;
        r->input = ImageInput::open(path, &config);
        if (!r->input) fail(geterror());
        r->spec = r->input->spec();
        if (r->spec.deep) fail("deep images cannot be read");
        if (r->spec.depth != 1) fail("volumes cannot be read");
        for (const ParamValue& value : r->spec.extra_attribs) {
            shim_attribute a;
            if (describe(value, a)) r->attributes.push_back(a);
        }
        *info = info_of(r->spec, int(r->attributes.size()));
        *reader = r.release();
    });
}

const char* shim_reader_channel(const shim_reader* reader, int index) noexcept {
    const auto& names = reader->spec.channelnames;
    return size_t(index) < names.size() ? names[index].c_str() : "";
}

void shim_reader_attribute(const shim_reader* reader, int index, shim_attribute* attribute) noexcept {
    *attribute = reader->attributes[index];
}

int shim_reader_read(shim_reader* reader, int format, void* pixels, shim_error* error) noexcept {
    return guarded(error, [&] {
        if (!reader->input->read_image(0, 0, 0, reader->spec.nchannels, type_of(format), pixels))
            fail(reader->input->geterror());
    });
}

void shim_reader_close(shim_reader* reader) noexcept {
    shim_error ignored;
    guarded(&ignored, [&] { delete reader; });
}

int shim_writer_create(const char* format, const shim_info* windows, shim_writer** writer,
                       shim_error* error) noexcept {
    return guarded(error, [&] {
        auto w = std::make_unique<shim_writer>();
        // By format, not by file name: the file may have a temporary name.
        w->output = ImageOutput::create(format);
        if (!w->output) fail(geterror());
        w->spec = ImageSpec(windows->width, windows->height, 0, TypeDesc::UNKNOWN);
        w->spec.x = windows->x;
        w->spec.y = windows->y;
        w->spec.full_x = windows->full_x;
        w->spec.full_y = windows->full_y;
        w->spec.full_width = windows->full_width;
        w->spec.full_height = windows->full_height;
        *writer = w.release();
    });
}

int shim_writer_channel(shim_writer* writer, const char* name, int format, shim_error* error) noexcept {
    return guarded(error, [&] {
        ImageSpec& spec = writer->spec;
        spec.channelnames.push_back(name);
        spec.channelformats.push_back(type_of(format));
        spec.nchannels = int(spec.channelnames.size());
        writer->mixed |= spec.channelformats.back() != spec.channelformats.front();
        if (std::strcmp(name, "A") == 0) spec.alpha_channel = spec.nchannels - 1;
        if (std::strcmp(name, "Z") == 0) spec.z_channel = spec.nchannels - 1;
    });
}

int shim_writer_attribute(shim_writer* writer, const shim_attribute* a, shim_error* error) noexcept {
    return guarded(error, [&] {
        ImageSpec& spec = writer->spec;
        switch (a->kind) {
        case SHIM_STRING: spec.attribute(a->name, string_view(static_cast<const char*>(a->data), a->count)); break;
        case SHIM_INT: spec.attribute(a->name, TypeDesc::INT, a->data); break;
        case SHIM_MATRIX: spec.attribute(a->name, TypeMatrix, a->data); break;
        case SHIM_RATIONAL: spec.attribute(a->name, TypeRational, a->data); break;
        default:
            if (a->count == 1)
                spec.attribute(a->name, TypeDesc::FLOAT, a->data);
            else
                spec.attribute(a->name, TypeDesc(TypeDesc::FLOAT, int(a->count)), a->data);
        }
    });
}

int shim_writer_write(shim_writer* writer, const char* path, const float* pixels, shim_error* error) noexcept {
    return guarded(error, [&] {
        ImageSpec& spec = writer->spec;
        spec.format = spec.channelformats.empty() ? TypeDesc(TypeDesc::FLOAT) : spec.channelformats[0];
        if (!writer->mixed)
            spec.channelformats.clear();
        else
            for (TypeDesc t : spec.channelformats) spec.format = t == TypeDesc::FLOAT ? t : spec.format;
        ImageOutput& out = *writer->output;
        if (!out.open(path, spec) || !out.write_image(TypeDesc::FLOAT, pixels) || !out.close()) fail(out.geterror());
    });
}

void shim_writer_destroy(shim_writer* writer) noexcept {
    shim_error ignored;
    guarded(&ignored, [&] { delete writer; });
}

int shim_textures_create(float megabytes, int max_open_files, int tile, shim_textures** textures,
                         shim_error* error) noexcept {
    return guarded(error, [&] {
        auto t = std::make_unique<shim_textures>();
        t->system = create_textures();
        if (!t->system) fail(geterror());
        TextureSystem& system = *t->system;
        system.attribute("max_memory_MB", megabytes);
        system.attribute("max_open_files", max_open_files);
        system.attribute("automip", 1);
        system.attribute("autotile", tile);
        system.attribute("accept_untiled", 1);
        system.attribute("accept_unmipped", 1);
        system.attribute("unassociatedalpha", 1);
        // A grey image is grey in all channels.
        system.attribute("gray_to_rgb", 1);
        *textures = t.release();
    });
}

int shim_textures_open(shim_textures* textures, const char* path, void** texture, shim_info* info,
                       shim_error* error) noexcept {
    return guarded(error, [&] {
        TextureSystem& system = *textures->system;
        auto* handle = system.get_texture_handle(ustring(path));
        if (!handle) fail(system.geterror());
        // A handle of a missing file is good until it is touched: touch it.
        int exists = 0;
        if (!system.get_texture_info(handle, nullptr, 0, ustring("exists"), TypeDesc::INT, &exists) || !exists) {
            std::string why = system.geterror();
            fail(why.empty() ? "the file does not exist or is no image" : why);
        }
        const ImageSpec* spec = system.imagespec(handle);
        if (!spec) fail(system.geterror());
        *info = info_of(*spec, 0);
        *texture = handle;
    });
}

void* shim_textures_thread(shim_textures* textures) noexcept {
    try {
        auto* thread = textures->system->create_thread_info();
        return textures->system->get_perthread_info(thread);
    } catch (...) {
        return nullptr;
    }
}

void shim_textures_thread_end(shim_textures* textures, void* thread) noexcept {
    shim_error ignored;
    guarded(&ignored,
            [&] { textures->system->destroy_thread_info(static_cast<TextureSystem::Perthread*>(thread)); });
}

int shim_textures_sample(shim_textures* textures, void* thread, void* texture, const shim_lookup* l,
                         float* result) noexcept {
    try {
        TextureOpt options;
        options.swrap = options.twrap = TextureOpt::Wrap(l->wrap);
        options.interpmode = TextureOpt::InterpMode(l->interpolation);
        options.mipmode = TextureOpt::MipMode(l->mip);
        options.anisotropic = l->anisotropy;
        return !textures->system->texture(static_cast<TextureSystem::TextureHandle*>(texture),
                                          static_cast<TextureSystem::Perthread*>(thread), options, l->s, l->t,
                                          l->dsdx, l->dtdx, l->dsdy, l->dtdy, l->channels, result);
    } catch (...) {
        return 1;
    }
}

void shim_textures_last_error(shim_textures* textures, shim_error* error) noexcept {
    guarded(error, [&] {
        std::string text = textures->system->geterror();
        say(error, text.empty() ? "unknown error" : text);
    });
}

int shim_textures_stats(shim_textures* textures, int64_t* memory_used, int64_t* tiles_read) noexcept {
    shim_error ignored;
    return guarded(&ignored, [&] {
        TextureSystem& system = *textures->system;
        if (!system.getattribute("stat:cache_memory_used", TypeDesc::INT64, memory_used)) *memory_used = 0;
        int tiles = 0;
        system.getattribute("stat:tiles_created", TypeDesc::INT, &tiles);
        *tiles_read = tiles;
    });
}

void shim_textures_destroy(shim_textures* textures) noexcept {
    shim_error ignored;
    guarded(&ignored, [&] { delete textures; });
}

} // extern "C"
