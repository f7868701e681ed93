//! Generates the bindings from the installed `embree4/rtcore.h`, so that they always match the library that is linked.
//!
//! `EMBREE_INCLUDE_DIR` and `EMBREE_LIB_DIR` name an Embree outside the system's own directories.

use std::env;
use std::fs;
use std::panic;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Argument filters, feature flags and `instPrimID` have the layout that the wrapper uses since this version.
const OLDEST: u32 = 40300;

fn main() -> ExitCode {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-env-changed=EMBREE_INCLUDE_DIR");
    println!("cargo::rerun-if-env-changed=EMBREE_LIB_DIR");
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            println!("cargo::error={message}");
            ExitCode::FAILURE
        }
    }
}

fn run() -> Result<(), String> {
    let include = include_dir()?;
    let config = include.join("embree4/rtcore_config.h");
    println!("cargo::rerun-if-changed={}", config.display());
    check_version(&config)?;
    generate(&include)?;
    if let Some(dir) = env::var_os("EMBREE_LIB_DIR") {
        println!("cargo::rustc-link-search=native={}", Path::new(&dir).display());
    }
    println!("cargo::rustc-link-lib=embree4");
    Ok(())
}

/// The directory that holds `embree4/rtcore.h`.
fn include_dir() -> Result<PathBuf, String> {
    let candidates = match env::var_os("EMBREE_INCLUDE_DIR") {
        Some(dir) => vec![PathBuf::from(dir)],
        None => vec![PathBuf::from("/usr/include"), PathBuf::from("/usr/local/include")],
    };
    let found = candidates.iter().find(|dir| dir.join("embree4/rtcore.h").is_file());
    found.cloned().ok_or_else(|| {
        let looked = candidates.iter().map(|dir| dir.display().to_string()).collect::<Vec<_>>().join(", ");
        format!(
            "embree4/rtcore.h is not in {looked}: run ci/setup (it installs libembree-dev, Embree 4.3 or later), \
             or set EMBREE_INCLUDE_DIR"
        )
    })
}

fn check_version(config: &Path) -> Result<(), String> {
    let text = fs::read_to_string(config).map_err(|why| format!("cannot read {}: {why}", config.display()))?;
    let version = defined(&text, "RTC_VERSION")
        .ok_or_else(|| format!("{} does not define RTC_VERSION: is it Embree's? run ci/setup", config.display()))?;
    if version / 10000 != OLDEST / 10000 || version < OLDEST {
        return Err(format!(
            "{} is of Embree {}.{}.{}, but 4.3 or a later 4 is needed: run ci/setup",
            config.display(),
            version / 10000,
            version / 100 % 100,
            version % 100
        ));
    }
    Ok(())
}

/// The number that `#define name number` gives.
fn defined(text: &str, name: &str) -> Option<u32> {
    text.lines().find_map(|line| {
        let mut words = line.split_whitespace();
        (words.next() == Some("#define") && words.next() == Some(name)).then(|| words.next()?.parse().ok())?
    })
}

fn generate(include: &Path) -> Result<(), String> {
    let builder = bindgen::Builder::default()
        .header_contents("embree.h", "#include <embree4/rtcore.h>\n")
        .clang_arg(format!("-I{}", include.display()))
        .allowlist_function("rtc.*")
        .allowlist_type("RTC.*")
        .allowlist_var("RTC_.*")
        .default_enum_style(bindgen::EnumVariation::Consts)
        .prepend_enum_name(false)
        .generate_comments(false)
        .derive_default(false)
        .parse_callbacks(Box::new(bindgen::CargoCallbacks::new()));
    // bindgen loads libclang at run time and panics, with a good message, where there is none.
    let bindings = panic::catch_unwind(panic::AssertUnwindSafe(|| builder.generate()))
        .map_err(|_| "libclang could not be loaded (see above): run ci/setup (it installs libclang-dev)".to_string())?
        .map_err(|why| format!("bindgen could not read embree4/rtcore.h ({why}): run ci/setup"))?;
    let out = PathBuf::from(env::var_os("OUT_DIR").ok_or("OUT_DIR is not set: build with cargo")?);
    bindings.write_to_file(out.join("bindings.rs")).map_err(|why| format!("cannot write the bindings: {why}"))
}
