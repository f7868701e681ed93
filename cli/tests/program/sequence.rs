//! Several frames in one run, and as jobs for a farm.

use std::fs;
use std::os::unix::fs::PermissionsExt;

use super::{Bench, SCENE, read};

/// Two scenes that are not alike.
fn bench() -> Bench {
    let bench = Bench::new();
    bench.write("shot.0001.pbrt", SCENE);
    bench.write("shot.0002.pbrt", &SCENE.replace("Translate 0 1 0", "Translate 1 1 0"));
    bench
}

fn bytes(bench: &Bench, name: &str) -> Vec<u8> {
    fs::read(bench.path(name)).unwrap()
}

#[test]
fn frames_of_a_sequence_are_those_rendered_alone() {
    let bench = bench();
    let job = ["render", "--spp", "8", "--progress", "alf"];
    let run = bench.succeed(&[&job[..], &["shot.####.pbrt", "-o", "all.####.exr", "--frames", "2,1..1"]].concat());
    for (scene, frame) in [("shot.0001.pbrt", "1"), ("shot.0002.pbrt", "2")] {
        bench.succeed(&[&job[..], &[scene, "-o", "alone.%d.exr", "--frame", frame]].concat());
        let [all, alone] = [format!("all.000{frame}.exr"), format!("alone.{frame}.exr")];
        assert!(bytes(&bench, &all) == bytes(&bench, &alone), "frame {frame}");
    }
    assert!(bytes(&bench, "all.0001.exr") != bytes(&bench, "all.0002.exr"));
    let lines: Vec<_> = run.stdout.lines().filter(|line| !line.contains("Memory")).collect();
    let last = ["Image: all.0002.exr", "ALF_PROGRESS 100%", "Image: all.0001.exr", "Finished Rendering"];
    assert!(last.iter().all(|line| lines.iter().filter(|known| *known == line).count() == 1), "{lines:?}");
    assert_eq!(lines.last(), Some(&"Finished Rendering"));
}

#[test]
fn slices_of_a_sequence_merge_to_its_frames() {
    let bench = bench();
    let job = ["render", "shot.####.pbrt", "--spp", "32", "--frames", "1-2", "--progress", "none"];
    bench.succeed(&[&job[..], &["-o", "whole.####.exr"]].concat());
    bench.succeed(&[&job[..], &["-o", "%02d.a.part", "--slice", "0/2"]].concat());
    bench.succeed(&[&job[..], &["-o", "%02d.b.part", "--slice", "1/2"]].concat());
    bench.succeed(&["merge", "--frames", "2,1", "%02d.b.part", "%02d.a.part", "-o", "merged.####.exr"]);
    for frame in ["0001", "0002"] {
        assert!(
            bytes(&bench, &format!("whole.{frame}.exr")) == bytes(&bench, &format!("merged.{frame}.exr")),
            "{frame}"
        );
    }
}

#[test]
fn frames_without_names_of_their_own_are_refused() {
    let bench = bench();
    let render = ["render", "shot.####.pbrt", "--frames", "1-2", "-o"];
    bench.fail(&[&render[..], &["all.exr"]].concat(), 2, &["all.exr", "####"]);
    bench.fail(&[&render[..], &["a.#.exr", "--stats", "stats.json"]].concat(), 2, &["stats.json", "####"]);
    bench.fail(&[&render[..], &["a.#.exr", "--checkpoint", "kept"]].concat(), 2, &["kept", "####"]);
    bench.fail(&[&render[..], &["a.#.exr", "--frame", "1"]].concat(), 2, &["--frame"]);
    bench.fail(&["merge", "a.#.part", "-o", "a.exr", "--frames", "1-2"], 2, &["a.exr", "####"]);
    bench.fail(&["render", "shot.####.pbrt", "-o", "a.exr", "--frames", "1-"], 2, &["\"1-\"", "1-10x2"]);
    // Without a number a name is a name.
    bench.fail(&["render", "shot.####.pbrt", "-o", "a.exr"], 3, &["shot.####.pbrt", "--frame", "--frames"]);
}

#[test]
fn a_missing_scene_is_found_before_the_first_frame_is_rendered() {
    let bench = bench();
    let render = ["render", "shot.####.pbrt", "-o", "a.####.exr", "--frames"];
    bench.fail(&[&render[..], &["1-3"]].concat(), 3, &["shot.0003.pbrt", "nothing was rendered"]);
    bench.fail(&[&render[..], &["1-9x2"]].concat(), 3, &["4 of 5", "shot.0003.pbrt", "shot.0009.pbrt"]);
    assert_eq!(bench.files(), ["shot.0001.pbrt", "shot.0002.pbrt"]);
}

#[test]
fn what_is_there_is_skipped_only_if_it_is_what_was_asked_for() {
    let bench = bench();
    for name in ["a.exr", "a.part"] {
        let job = ["render", "shot.0001.pbrt", "-o", name, "--spp", "8", "--skip-existing", "--progress", "alf"];
        bench.succeed(&job);
        let first = bytes(&bench, name);
        let run = bench.succeed(&job);
        assert!(run.stderr.contains("nothing to do") && run.stdout.ends_with("Finished Rendering\n"), "{}", run.stderr);
        let run = bench.succeed(&[&job[..], &["--seed", "5"]].concat());
        assert!(!run.stderr.contains("nothing to do") && bytes(&bench, name) != first, "{name}: {}", run.stderr);
    }
}

#[test]
fn what_reached_its_goal_is_complete_for_that_goal() {
    let bench = bench();
    let job = ["render", "shot.0001.pbrt", "-o", "a.exr", "--spp", "4096", "--skip-existing", "--stats", "a.json"];
    let with = |goal: &[&'static str]| bench.succeed(&[&job[..], goal].concat()).stderr;
    let loose = ["--target-error", "1000"];
    assert!(with(&loose).contains("good enough"));
    let stats: serde_json::Value = serde_json::from_slice(&bytes(&bench, "a.json")).unwrap();
    assert_eq!(stats["complete"], true);
    assert!(with(&loose).contains("nothing to do"));
    for other in [&["--target-error", "900"][..], &["--target-error", "1000", "--noise-threshold", "100"]] {
        assert!(!with(other).contains("nothing to do"), "{other:?}");
    }
    // What a limit of time ended is not complete, with a goal or without.
    for goal in [&[][..], &["--target-error", "1e-9"]] {
        let limited = [goal, &["--time-limit", "0.000001s"]].concat();
        assert!(!with(&limited).contains("nothing to do") && !with(&limited).contains("nothing to do"), "{goal:?}");
    }
}

#[test]
fn job_files_are_for_the_engine() {
    let bench = bench();
    let shot = ["shot.####.pbrt", "-o", "out/shot.####.exr", "--frames", "1-2", "--slices", "2"];
    let run = bench.succeed(&[&["farm", "openjd"], &shot[..], &["--", "--spp", "32"]].concat());
    assert!(run.stdout.starts_with("specificationVersion: jobtemplate-2023-09\n"), "{}", run.stdout);
    bench.succeed(&[&["farm", "slurm"], &shot[..], &["--folder", "a/job", "--", "--spp", "32"]].concat());
    let mode = |name: &str| fs::metadata(bench.path(name)).unwrap().permissions().mode();
    assert!(mode("a/job/submit") & 0o111 != 0 && mode("a/job/render.sbatch") & 0o111 == 0);
    // Unless told the scripts name this program, which no PATH need have.
    let merge = String::from_utf8(bytes(&bench, "a/job/merge.sbatch")).unwrap();
    assert!(merge.contains(&format!("\nexec {} merge ", env!("CARGO_BIN_EXE_tessera"))), "{merge}");
    let mut openjd = bench.command(&[&["farm", "openjd"], &shot[..], &["--", "--spp", "32"]].concat());
    let run = super::Run::of(openjd.env("PATH", "/nowhere").output().unwrap());
    assert!(run.code == 0 && run.stderr.contains("--program"), "{}", run.stderr);
    bench.fail(&[&["farm", "openjd"], &shot[..], &["--", "--sp", "32"]].concat(), 2, &["--sp"]);
    // As the scene has it, and where the scene is not to be read here.
    let sixteen = ["-o", "out/shot.####.exr", "--frames", "1-2", "--slices", "16", "--folder", "b"];
    bench.fail(&[&["farm", "slurm", "shot.####.pbrt"], &sixteen[..]].concat(), 2, &["at most 1;"]);
    assert!(!bench.path("b").exists());
    let run = bench.succeed(&[&["farm", "slurm", "elsewhere.####.pbrt"], &sixteen[..]].concat());
    assert!(run.stderr.contains("--spp"), "{}", run.stderr);
    let uneven =
        ["farm", "openjd", "shot.####.pbrt", "-o", "a.#.exr", "--frames", "1", "--slices", "7", "--", "--spp", "100"];
    let run = bench.succeed(&uneven);
    assert!(run.stderr.contains("1 of 7 has 8 samples, the largest 16"), "{}", run.stderr);
}

#[test]
fn moving_averages_go_over_the_frames_of_a_command() {
    let bench = Bench::new();
    bench.write("still.pbrt", SCENE);
    let render = |name: &str, seed: &str, more: &[&str]| {
        let job = ["render", "still.pbrt", "--frames", "1-6", "--filter", "talk", "--spp", "4", "--seed", seed];
        bench.succeed(&[&job[..], &["-o", &format!("{name}.#.exr")], more].concat());
    };
    let pixels = |name: &str| read(&bench.path(name)).pixels;
    // In the middle of them: at edges the noise is that of pixels, which no cell averages.
    let difference = |a: &str, b: &str| {
        let squares = pixels(a).into_iter().zip(pixels(b)).map(|(a, b)| (a - b).powi(2));
        let mut squares: Vec<f32> = squares.filter(|square| *square > 0.0).collect();
        squares.sort_unstable_by(f32::total_cmp);
        squares[squares.len() / 2]
    };
    for seed in ["1", "2"] {
        render(&format!("alone{seed}"), seed, &[]);
        render(&format!("moving{seed}"), seed, &["--temporal", "0.8", "--threads", "1"]);
    }
    // The first has no past, and later ones are mixed with theirs: of cells' noise, which two seeds have each their own, Σ w² =
    // 0.21 is left for weights w of 0.8⁵ and 0.2 · 0.8ᵏ, k < 5; and all of the dither, as paths read cells at random.
    assert!(pixels("alone1.1.exr") == pixels("moving1.1.exr"));
    let left = difference("moving1.6.exr", "moving2.6.exr") / difference("alone1.6.exr", "alone2.6.exr");
    println!("noise of the sixth frame: {left:.3} (0.21 and dither)");
    assert!((0.1..0.6).contains(&left), "{left}");
    let since = |name: &str| read(&bench.path(name)).attribute("tessera/averagedSince").cloned();
    assert_eq!(since("moving1.6.exr"), Some(oiio::Attribute::Int(1)));
    assert_eq!(since("alone1.6.exr"), None);
    // The same bits whatever the threads, and other frames before are another average.
    render("again", "1", &["--temporal", "0.8", "--threads", "2"]);
    for frame in 1..=6 {
        assert!(
            bytes(&bench, &format!("again.{frame}.exr")) == bytes(&bench, &format!("moving1.{frame}.exr")),
            "{frame}"
        );
    }
    bench.succeed(&[
        "render",
        "still.pbrt",
        "--frames",
        "5,6",
        "--filter",
        "talk",
        "--temporal",
        "0.8",
        "-o",
        "late.#.exr",
    ]);
    assert_eq!(since("late.6.exr"), Some(oiio::Attribute::Int(5)));
    let skip = ["render", "still.pbrt", "--frames", "1-2", "--filter", "talk", "--temporal", "0.8", "--skip-existing"];
    bench.fail(&[&skip[..], &["-o", "moving1.#.exr"]].concat(), 2, &["--skip-existing", "--temporal"]);
}
