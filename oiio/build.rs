//! Compiles the C++ shim and links OpenImageIO.

use std::path::PathBuf;
use std::process::Command;

fn main() {
    println!("cargo::rerun-if-changed=src/shim.h");
    println!("cargo::rerun-if-changed=src/shim.cc");
    println!("cargo::rerun-if-env-changed=OPENIMAGEIO_ROOT");
    println!("cargo::rerun-if-env-changed=CPLUS_INCLUDE_PATH");

    let pkg = pkg_config();
    let mut includes: Vec<PathBuf> = values(&pkg, "-I");
    let mut libraries: Vec<PathBuf> = values(&pkg, "-L");
    if let Some(root) = std::env::var_os("OPENIMAGEIO_ROOT").map(PathBuf::from) {
        includes.insert(0, root.join("include"));
        libraries.insert(0, root.join("lib"));
    }
    if !header_found(&includes) {
        panic!(
            "OpenImageIO's headers were not found (OpenImageIO/imageio.h). Run `ci/setup` from the top of this \
             repository, or install `libopenimageio-dev`; for a copy elsewhere set OPENIMAGEIO_ROOT to the directory \
             that holds its `include` and `lib`."
        );
    }

    cc::Build::new()
        .cpp(true)
        .std("c++17")
        .file("src/shim.cc")
        .includes(&includes)
        .flag("-fvisibility=hidden")
        // The headers are the system's: their warnings are not ours to fix.
        .flag_if_supported("-Wno-deprecated-declarations")
        .flag_if_supported("-Wno-unused-parameter")
        .compile("oiio_shim");
    for path in libraries {
        println!("cargo::rustc-link-search=native={}", path.display());
    }
    println!("cargo::rustc-link-lib=dylib=OpenImageIO");
    println!("cargo::rustc-link-lib=dylib=OpenImageIO_Util");
}

/// What `pkg-config` says; nothing where there is no `pkg-config`, because the defaults of the compiler then decide.
fn pkg_config() -> String {
    Command::new("pkg-config")
        .args(["--cflags", "--libs", "OpenImageIO"])
        .output()
        .ok()
        .filter(|output| output.status.success())
        .map(|output| String::from_utf8_lossy(&output.stdout).into_owned())
        .unwrap_or_default()
}

/// The directories that follow `flag`.
fn values(flags: &str, flag: &str) -> Vec<PathBuf> {
    flags.split_whitespace().filter_map(|word| word.strip_prefix(flag)).map(PathBuf::from).collect()
}

fn header_found(includes: &[PathBuf]) -> bool {
    let listed = std::env::var_os("CPLUS_INCLUDE_PATH").unwrap_or_default();
    let standard = ["/usr/include", "/usr/local/include"].map(PathBuf::from);
    includes
        .iter()
        .cloned()
        .chain(std::env::split_paths(&listed))
        .chain(standard)
        .any(|directory| directory.join("OpenImageIO/imageio.h").is_file())
}
