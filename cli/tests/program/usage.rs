//! Wrong and unusual command lines.

use super::Bench;

#[test]
fn help_names_commands_exit_codes_and_examples() {
    let bench = Bench::new();
    let help = bench.succeed(&["--help"]).stdout;
    for word in ["render", "info", "compare", "preview", "Exit codes"] {
        assert!(help.contains(word), "{help}");
    }
    let help = bench.succeed(&["render", "--help"]).stdout;
    for word in ["Examples:", "--sample-range", "--time-limit", "SOURCE_DATE_EPOCH", "openjd", "--filter-set"] {
        assert!(help.contains(word), "{help}");
    }
    assert!(bench.succeed(&["--version"]).stdout.starts_with("tessera "));
}

#[test]
fn a_wrong_command_line_exits_with_2_and_says_why() {
    let bench = Bench::new();
    bench.fail(&[], 2, &["Usage"]);
    bench.fail(&["bake"], 2, &["bake"]);
    bench.fail(&["render"], 2, &["--output", "<SCENE>"]);
    bench.fail(&["render", "a.pbrt", "-o", "a.exr", "--sppp", "4"], 2, &["--sppp", "--spp"]);
    bench.fail(&["render", "a.pbrt", "-o", "a.exr", "--crop", "0,1,0,2"], 2, &["--crop", "X0 < X1 <= 1"]);
    bench.fail(&["render", "a.pbrt", "-o", "a.exr", "--spp", "8", "--sample-range", "0:9"], 2, &["0:9", "--spp"]);
}

#[test]
fn a_wrong_setting_of_the_filter_is_answered_by_those_there_are() {
    let bench = Bench::new();
    // The scene does not exist, which would be exit code 3.
    let fail = |arguments: &[&str], words: &[&str]| {
        bench.fail(&[&["render", "none.pbrt", "-o", "a.exr"], arguments].concat(), 2, words);
    };
    fail(&["--filter", "best"], &["best", "none", "talk", "adaptive"]);
    fail(
        &["--filter-set", "tree=3"],
        &["\"adaptive\" has no setting \"tree\"", "trees (1 to 8)", "leaf (auto or above 0)"],
    );
    fail(&["--filter-set", "leaf=1,trees=9"], &["trees cannot be \"9\": it must be 1 to 8"]);
    fail(&["--filter-set", "trees"], &["trees", "KEY=VALUE"]);
    fail(&["--filter", "talk", "--filter-set", "trees=3"], &["\"talk\" has no setting \"trees\"", "probes (1 to 255)"]);
    fail(&["--filter", "talk", "--filter-set", "jitter=big"], &["jitter", "none, square or disk"]);
    fail(&["--filter", "talk", "--filter-set", "eviction=health"], &["reading at the end needs cells that stay"]);
    fail(&["--filter", "none", "--filter-set", "trees=3"], &["it has none"]);
    fail(&["--filter", "talk", "--temporal", "1.5"], &["--temporal", "less than 1"]);
    fail(&["--filter", "talk", "--temporal", "0.8"], &["--temporal", "--frames"]);
    fail(&["--filter", "talk", "--filter-set", "temporal=0.8"], &["--temporal", "--frames"]);
    fail(&["--temporal", "0.8"], &["--temporal", "--filter talk"]);
}

#[test]
fn outputs_are_checked_before_anything_is_read() {
    let bench = Bench::new();
    bench.write("file", "");
    // The scene does not exist, which would be exit code 3.
    bench.fail(&["render", "none.pbrt", "-o", "a.png"], 2, &["a.png", ".exr", "tessera preview"]);
    bench.fail(&["render", "none.pbrt", "-o", "none/a.exr"], 4, &["none/a.exr", "does not exist"]);
    bench.fail(&["render", "none.pbrt", "-o", "file/a.exr"], 4, &["file/a.exr"]);
    bench.fail(&["render", "none.pbrt", "-o", "a.exr", "--aov", "P,motion"], 2, &["motion", "nothing moves"]);
    bench.fail(&["render", "none.pbrt", "-o", "a.exr", "--stats", "none/s.json"], 4, &["none/s.json"]);
    bench.fail(&["render", "none.pbrt", "-o", "a.exr", "--log-file", "none/log"], 4, &["none/log"]);
    bench.fail(&["preview", "none.exr", "-o", "a.jpg"], 2, &["a.jpg", ".png"]);
    bench.fail(&["compare", "none.exr", "none.exr", "-o", "a.png"], 2, &["a.png", ".exr"]);
    assert_eq!(bench.files(), ["file"]);
}

#[test]
fn inputs_are_not_written_over() {
    let bench = Bench::new();
    bench.write("scene.pbrt", super::SCENE);
    bench.write_image("a.exr", 4, 4, |_, _| [0.5; 3]);
    bench.write_image("b.exr", 4, 4, |_, _| [0.5; 3]);
    let all = || ["scene.pbrt", "a.exr", "b.exr"].map(|name| std::fs::read(bench.path(name)).unwrap());
    let before = all();
    let render = ["render", "scene.pbrt", "-o", "c.exr"];
    bench.fail(&[&render[..], &["--stats", "scene.pbrt"]].concat(), 2, &["scene.pbrt", "is read"]);
    bench.fail(&[&render[..], &["--log-file", "./scene.pbrt"]].concat(), 2, &["scene.pbrt", "is read"]);
    for output in ["a.exr", "b.exr"] {
        bench.fail(&["compare", "a.exr", "b.exr", "-o", output], 2, &[output, "is read"]);
        bench.fail(
            &["compare", "a.exr", "a.exr", "--second-reference", "b.exr", "-o", output],
            2,
            &[output, "is read"],
        );
        bench.fail(&["compare", "a.exr", "b.exr", "--log-file", output], 2, &[output, "is read"]);
    }
    std::fs::copy(bench.path("a.exr"), bench.path("a.png")).unwrap();
    bench.fail(&["preview", "a.png", "-o", "a.png"], 2, &["a.png", "is read"]);
    assert!(all() == before && !bench.path("c.exr").exists());
}

#[test]
fn a_window_without_pixels_is_the_options_fault() {
    let bench = Bench::new();
    bench.write("scene.pbrt", super::SCENE);
    let render = ["render", "scene.pbrt", "-o", "a.exr"];
    bench.fail(&[&render[..], &["--pixel-bounds=100,200,100,200"]].concat(), 2, &["--pixel-bounds", "48 x 32"]);
    bench.fail(&[&render[..], &["--crop", "0.001,0.002,0,1"]].concat(), 2, &["--crop", "48 x 32"]);
}

/// Linux takes any bytes.
#[test]
fn paths_that_are_no_text_are_read_and_refused_as_images() {
    use std::os::unix::ffi::OsStrExt;
    let bench = Bench::new();
    let at = |bytes: &[u8]| bench.path("").join(std::ffi::OsStr::from_bytes(bytes));
    std::fs::write(at(b"b\xff.pbrt"), super::SCENE).unwrap();
    let run = |words: &[&str], path: &[u8], more: &[&str]| {
        super::Run::of(bench.command(words).arg(at(path)).args(more).output().unwrap())
    };
    let output = ["-o", "a.exr", "--spp", "1", "--stats", "a.json"];
    let rendered = run(&["render"], b"b\xff.pbrt", &output);
    assert_eq!(rendered.code, 0, "{}", rendered.stderr);
    let stats: serde_json::Value = serde_json::from_slice(&std::fs::read(bench.path("a.json")).unwrap()).unwrap();
    assert!(stats["scene"].as_str().unwrap().ends_with("b\u{fffd}.pbrt"), "{stats}");
    let info = run(&["info", "--format", "json"], b"b\xff.pbrt", &[]).json();
    assert!(info["files"][0].as_str().unwrap().ends_with("b\u{fffd}.pbrt"), "{info}");
    let refused = run(&["render", "none.pbrt", "-o"], b"b\xff.exr", &[]);
    assert!(refused.code == 4 && refused.stderr.contains("UTF-8"), "{}", refused.stderr);
}

#[test]
fn a_missing_input_exits_with_3_and_names_it() {
    let bench = Bench::new();
    bench.write("no.exr", "this is no image");
    bench.fail(&["render", "none.pbrt", "-o", "a.exr"], 3, &["none.pbrt", "Error: "]);
    bench.fail(&["info", "none.pbrt"], 3, &["none.pbrt", "Error: "]);
    bench.fail(&["compare", "none.exr", "no.exr"], 3, &["none.exr"]);
    bench.fail(&["compare", "no.exr", "no.exr"], 3, &["no.exr"]);
    bench.fail(&["preview", "no.exr", "-o", "a.png"], 3, &["no.exr"]);
    assert_eq!(bench.files(), ["no.exr"]);
}

#[test]
fn quiet_says_nothing_but_errors_and_the_log_file_everything() {
    let bench = Bench::new();
    bench.write_image("a.exr", 4, 4, |_, _| [0.5; 3]);
    let run = bench.succeed(&["preview", "a.exr", "-o", "a.png", "--quiet", "--log-file", "log"]);
    assert_eq!((run.stdout.as_str(), run.stderr.as_str()), ("", ""));
    let run = bench.run(&["preview", "none.exr", "-o", "b.png", "--quiet", "--log-file", "log"]);
    assert!(run.stderr.starts_with("Error: ") && run.stderr.lines().count() == 1, "{}", run.stderr);
    let log = std::fs::read_to_string(bench.path("log")).unwrap();
    assert!(log.contains("info: wrote a.png") && log.contains("error: cannot open"), "{log}");
}

#[test]
fn file_names_cannot_forge_lines() {
    let bench = Bench::new();
    let name = "x\nALF_PROGRESS 99%\nopenjd_progress: 50.exr";
    let run = bench.fail(&["preview", name, "-o", "a.png"], 3, &["ALF-PROGRESS"]);
    let forged = |line: &str| line.contains("ALF_PROGRESS") || line.starts_with("openjd_");
    assert!(!run.stderr.lines().any(forged), "{}", run.stderr);
}
