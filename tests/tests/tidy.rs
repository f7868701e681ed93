//! Rules of the house that a test can check.
#![allow(clippy::print_stdout, reason = "tests print the figures that they judge")]

use std::fs;
use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// Every Rust file below `folder`, sorted.
fn rust_files(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).expect("a folder of the workspace").map(Result::unwrap) {
        let path = entry.path();
        if path.is_dir() {
            files.extend(rust_files(&path));
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            files.push(path);
        }
    }
    files.sort();
    files
}

/// Lines of code before the file's tests, numbered from 1, without comments.
fn code(path: &Path) -> Vec<(usize, String)> {
    let text = fs::read_to_string(path).expect("a file of the workspace");
    text.lines()
        .zip(1..)
        .take_while(|(line, _)| !line.starts_with("#[cfg(test)]"))
        .filter(|(line, _)| !line.trim_start().starts_with("//"))
        .map(|(line, number)| (number, line.to_owned()))
        .collect()
}

#[test]
fn modules_of_the_renderer_use_only_what_stands_before_them() {
    let source = root().join("renderer/src");
    let order: Vec<String> = code(&source.join("lib.rs"))
        .iter()
        .filter_map(|(_, line)| line.strip_prefix("pub mod ")?.strip_suffix(';').map(str::to_owned))
        .collect();
    let rank = |module: &str| order.iter().position(|name| name == module);
    let mut wrong = Vec::new();
    for file in rust_files(&source) {
        let own = file.strip_prefix(&source).unwrap().components().next().unwrap();
        let own = own.as_os_str().to_string_lossy();
        let own = own.trim_end_matches(".rs");
        let Some(own_rank) = rank(own) else { continue };
        // A module's tests may stand in files of their own, and use anything.
        if file.strip_prefix(&source).unwrap().to_string_lossy().contains("test") {
            continue;
        }
        for (number, line) in code(&file) {
            for used in line.split("crate::").skip(1) {
                let used: String = used.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
                if rank(&used).is_some_and(|used_rank| used_rank > own_rank) {
                    wrong.push(format!("{}:{number}: {own} uses {used}", file.display()));
                }
            }
        }
    }
    assert!(order.len() > 10, "lib.rs no longer declares its modules one a line");
    let last: Vec<&str> = order.iter().map(String::as_str).skip_while(|&name| name != "integrator").collect();
    assert_eq!(
        last,
        ["integrator", "draft", "film", "filtering", "frame", "part", "error", "render"],
        "the last modules of lib.rs"
    );
    assert!(wrong.is_empty(), "against the order in lib.rs:\n{}", wrong.join("\n"));
}

#[test]
fn unsafe_code_is_where_it_is_allowed_and_nowhere_else() {
    let benches = ["bench", "bench_features", "bench_filter"].map(|name| format!("tests/src/bin/{name}.rs"));
    let rooms = ["filter/src/lib.rs", "renderer/src/lib.rs", "cli/src/main.rs", "tests/src/lib.rs"];
    for room in rooms.into_iter().map(str::to_owned).chain(benches) {
        let text = fs::read_to_string(root().join(&room)).unwrap();
        assert!(text.contains("#![forbid(unsafe_code)]"), "{room} does not forbid unsafe code");
    }
}

#[test]
fn the_filter_knows_no_renderer_no_file_and_no_clock() {
    let manifest = fs::read_to_string(root().join("filter/Cargo.toml")).unwrap();
    let section = manifest.split("[dependencies]").nth(1).expect("the filter's dependencies");
    let names: Vec<&str> = section
        .lines()
        .take_while(|line| !line.starts_with('['))
        .filter_map(|line| line.split(['.', ' ', '=']).next())
        .filter(|name| !name.is_empty())
        .collect();
    assert_eq!(names, ["glam", "rayon"], "what the filter depends on");
    let outside = ["std::time", "std::fs", "std::io", "std::net", "std::process", "std::thread"];
    let mut found = Vec::new();
    for file in rust_files(&root().join("filter/src")) {
        for (number, line) in code(&file) {
            if outside.iter().any(|word| line.contains(word)) {
                found.push(format!("{}:{number}: {line}", file.display()));
            }
        }
    }
    assert!(found.is_empty(), "the filter looks outside:\n{}", found.join("\n"));
}

#[test]
fn nothing_is_left_undone_or_left_out() {
    // Spelt so that this file does not find itself.
    let words = ["todo", "unimplemented", "dbg"].map(|word| format!("{word}!("));
    let ignored = format!("#[{}", "ignore");
    let mut found = Vec::new();
    for room in ["embree-sys", "embree", "oiio", "filter", "renderer", "cli", "tests"] {
        for file in rust_files(&root().join(room)) {
            let text = fs::read_to_string(&file).unwrap();
            for (line, number) in text.lines().zip(1..) {
                if words.iter().any(|word| line.contains(word)) || line.contains(&ignored) {
                    found.push(format!("{}:{number}: {line}", file.display()));
                }
            }
        }
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
}

#[test]
fn the_path_loop_fits_on_a_screen() {
    let lines = code(&root().join("renderer/src/integrator/path.rs"));
    let start = lines.iter().position(|(_, line)| line.starts_with("pub fn trace")).expect("the path loop is `trace`");
    let length = lines[start..].iter().position(|(_, line)| line == "}").unwrap() + 1;
    println!("the path loop has {length} lines");
    assert!(length <= 60, "the path loop has {length} lines, more than the 60 that a screen holds");
}

#[test]
fn every_source_that_is_cited_is_in_the_bibliography() {
    let bibliography = fs::read_to_string(root().join("BIBLIOGRAPHY.md")).unwrap();
    let is_key = |text: &str| {
        let (name, rest) = text.split_at(text.find(|c: char| c.is_ascii_digit()).unwrap_or(text.len()));
        name.len() > 2
            && name.starts_with(|c: char| c.is_ascii_uppercase())
            && name.chars().all(|c| c.is_ascii_alphabetic())
            && rest.len() >= 2
            && rest[..2].chars().all(|c| c.is_ascii_digit())
            && rest.len() <= 3
    };
    let (mut found, mut missing) = (0, Vec::new());
    for room in ["embree-sys", "embree", "oiio", "filter", "renderer", "cli", "tests/src"] {
        for file in rust_files(&root().join(room)) {
            let text = fs::read_to_string(&file).unwrap();
            // A citation is \[Key\] in documentation and [Key] elsewhere.
            for key in text.split('[').skip(1).filter_map(|rest| rest.split(']').next()) {
                let key = key.trim_end_matches('\\');
                if is_key(key) {
                    found += 1;
                    if !bibliography.contains(&format!("| {key} |")) {
                        missing.push(format!("{}: {key}", file.display()));
                    }
                }
            }
        }
    }
    assert!(found > 20, "only {found} citations: are they still written as keys in brackets?");
    assert!(missing.is_empty(), "not in BIBLIOGRAPHY.md:\n{}", missing.join("\n"));
}
