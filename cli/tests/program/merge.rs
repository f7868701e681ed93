//! `tessera merge`, and going on from checkpoints.

use super::{Bench, SCENE, read};

fn bench() -> Bench {
    let bench = Bench::new();
    bench.write("scene.pbrt", SCENE);
    bench
}

fn bytes(bench: &Bench, name: &str) -> Vec<u8> {
    std::fs::read(bench.path(name)).unwrap()
}

/// Renders with 64 samples and some more options.
fn render(bench: &Bench, options: &[&str]) {
    let job = ["render", "scene.pbrt", "--spp", "64", "--aov", "all", "--progress", "none"];
    bench.succeed(&[&job[..], options].concat());
}

/// `ci/test-farm` has the whole table of slices and threads.
#[test]
fn a_split_gives_the_bytes_of_one_machine() {
    let bench = bench();
    for (filter, slices, threads) in [("none", 7, "1"), ("adaptive", 3, "2")] {
        render(&bench, &["-o", "whole.exr", "--filter", filter]);
        let whole = bytes(&bench, "whole.exr");
        let mut names: Vec<String> = (0..slices).map(|slice| format!("{slice}.part")).collect();
        for (slice, name) in names.iter().enumerate() {
            let slice = format!("{slice}/{slices}");
            render(&bench, &["-o", name, "--slice", &slice, "--filter", filter, "-t", threads]);
        }
        names.rotate_left(slices / 2);
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        bench.succeed(&[&["merge", "-o", "merged.exr"], &names[..]].concat());
        assert!(bytes(&bench, "merged.exr") == whole, "{slices} slices, filter {filter}");
        // By way of a part of parts, and of a part of all.
        let (some, rest) = names.split_at(slices.div_ceil(2));
        bench.succeed(&[&["merge", "-o", "some.part"], some].concat());
        bench.succeed(&[&["merge", "-o", "merged.exr", "some.part"], rest].concat());
        assert!(bytes(&bench, "merged.exr") == whole, "{slices} slices by way of a part, filter {filter}");
        render(&bench, &["-o", "whole.part", "--filter", filter]);
        bench.succeed(&[&["merge", "-o", "all.part"], &names[..]].concat());
        assert!(bytes(&bench, "all.part") == bytes(&bench, "whole.part"), "the part of all, filter {filter}");
    }
}

/// The frame's estimate is the same in the log, in the statistics and in the image; that of parts is of the frame with all of
/// them against the frame with some.
#[test]
fn a_filtered_frame_of_parts_knows_its_error() {
    let bench = bench();
    let job = ["render", "scene.pbrt", "--spp", "64", "--aov", "error", "--filter", "adaptive", "--progress", "none"];
    let render = |options: &[&str]| bench.succeed(&[&job[..], options].concat());
    let run = render(&["-o", "whole.exr", "--stats", "whole.json"]);
    let stats: serde_json::Value = serde_json::from_slice(&bytes(&bench, "whole.json")).unwrap();
    let figure = |path: &str| stats.pointer(path).and_then(serde_json::Value::as_f64).unwrap();
    let whole = ["/error/relmse", "/error/interval/0", "/error/interval/1"].map(figure);
    let estimate = |name: &str, log: &str| {
        let image = read(&bench.path(name));
        let text = |key: &str| match image.attribute(key) {
            Some(oiio::Attribute::Text(text)) => text.clone(),
            other => panic!("{name}: {key} is {other:?}"),
        };
        let numbers = |text: String| text.split(' ').map(|x| x.parse().unwrap()).collect::<Vec<f64>>();
        let (relmse, interval) = (numbers(text("tessera/relMSE"))[0], numbers(text("tessera/relMSE95")));
        assert!(interval[0] > 0.0 && interval[0] < relmse && relmse < interval[1], "{name}: {relmse} {interval:?}");
        let told = log.split("estimated relMSE ").nth(1).and_then(|rest| rest.split(' ').next()?.parse::<f64>().ok());
        // To three digits.
        assert!(told.is_some_and(|told| (told / relmse - 1.0).abs() < 0.0051), "{name}: {log}");
        // Standard errors are those of pixels: their squares over the image's make up the estimate, to a factor of two, for
        // weights differ.
        let channel = |name: &str| image.channel(name).unwrap();
        let pixels = || image.pixels.chunks_exact(image.channels.len());
        let (values, errors) = (["R", "G", "B"].map(channel), ["error.R", "error.G", "error.B"].map(channel));
        let mean = values.map(|c| pixels().map(|p| f64::from(p[c])).sum::<f64>() / pixels().len() as f64);
        let term = |p: &[f32], c: usize| {
            f64::from(p[errors[c]]).powi(2) / (f64::from(p[values[c]]).powi(2) + 0.01 * mean[c] * mean[c])
        };
        let sum: f64 = pixels().map(|p| (0..3).map(|c| term(p, c)).sum::<f64>()).sum();
        let ratio = sum / (3 * pixels().len()) as f64 / relmse;
        assert!((0.5..2.0).contains(&ratio), "{name}: {ratio}");
        [relmse, interval[0], interval[1]]
    };
    assert_eq!(estimate("whole.exr", &run.stderr), whole);
    for (slices, first) in [(2, "0"), (4, "0"), (4, "3")] {
        let mut names: Vec<String> = (0..slices).map(|slice| format!("{slice}.part")).collect();
        for (slice, name) in names.iter().enumerate() {
            render(&["-o", name, "--slice", &format!("{slice}/{slices}")]);
        }
        names.sort_by_key(|name| !name.starts_with(first));
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        let run = bench.succeed(&[&["merge", "-o", "merged.exr"], &names[..]].concat());
        let merged = estimate("merged.exr", &run.stderr);
        // Half of the samples were held out, if not the same half: the intervals of both overlap.
        assert!(merged[1] < whole[2] && whole[1] < merged[2], "{slices} slices: {merged:?}, at once {whole:?}");
        let beauty = |name: &str| {
            let image = read(&bench.path(name));
            let of = |p: &[f32]| ["R", "G", "B"].map(|name| p[image.channel(name).unwrap()].to_bits());
            image.pixels.chunks_exact(image.channels.len()).map(of).collect::<Vec<_>>()
        };
        assert!(beauty("merged.exr") == beauty("whole.exr"), "{slices} slices differ from the frame");
    }
}

#[test]
fn parts_that_do_not_make_a_frame_are_refused_by_name() {
    let bench = bench();
    for (name, options) in [
        ("a.part", &["--slice", "0/4"][..]),
        ("b.part", &["--slice", "1/4"]),
        ("half.part", &["--slice", "0/2"]),
        ("last.part", &["--slice", "3/4"]),
        ("seed.part", &["--slice", "1/4", "--seed", "9"]),
        ("plain.part", &["--slice", "1/4", "--filter", "none"]),
        ("within.part", &["--sample-range", "16:21"]),
    ] {
        render(&bench, &[&["-o", name], options].concat());
    }
    bench.write("not.part", "Film \"rgb\" and the rest");
    let good = bytes(&bench, "b.part");
    std::fs::write(bench.path("cut.part"), &good[..good.len() - 100]).unwrap();
    let mut flipped = good.clone();
    flipped[good.len() / 2] ^= 1;
    std::fs::write(bench.path("flipped.part"), flipped).unwrap();
    let mut newer = good;
    newer[7] = 77;
    std::fs::write(bench.path("newer.part"), newer).unwrap();
    for (parts, words) in [
        (&["a.part", "half.part"][..], &["a.part", "half.part", "0:16", "leave one"][..]),
        (&["a.part", "last.part"], &["16:48", "--partial"]),
        (&["a.part", "seed.part"], &["a.part", "seed.part", "seed", "\"9\""]),
        (&["a.part", "plain.part"], &["plain.part", "filter", "\"none\""]),
        (&["a.part", "within.part"], &["within.part", "21", "--resume"]),
        (&["a.part", "not.part"], &["not.part", "not a part"]),
        (&["a.part", "cut.part"], &["cut.part", "ends too early"]),
        (&["a.part", "flipped.part"], &["flipped.part", "damaged"]),
        (&["a.part", "newer.part"], &["newer.part", "version 77"]),
        (&["a.part", "none.part"], &["none.part", "No such file"]),
    ] {
        let run = bench.run(&[&["merge", "-o", "out.exr", "--partial"], parts].concat());
        let run =
            if words.contains(&"--partial") { bench.run(&[&["merge", "-o", "out.exr"], parts].concat()) } else { run };
        assert_eq!(run.code, 3, "{parts:?}: {}", run.stderr);
        assert!(words.iter().all(|word| run.stderr.contains(word)), "{parts:?}: {}", run.stderr);
    }
    assert!(bench.files().iter().all(|name| !name.contains("part-")), "{:?}", bench.files());
    bench.succeed(&["merge", "-o", "out.exr", "--partial", "a.part", "last.part"]);
    let image = read(&bench.path("out.exr"));
    assert_eq!(image.attribute("tessera/complete"), Some(&oiio::Attribute::Int(0)));
    assert_eq!(image.attribute("tessera/sampleRange"), Some(&oiio::Attribute::Text("0:16,48:64".into())));
    let run = bench.run(&["render", "scene.pbrt", "-o", "x.part", "--spp", "16", "--slice", "4/7"]);
    assert_eq!(run.code, 2);
    assert!(run.stderr.contains("at most 4;") && run.stderr.contains("epoch"), "{}", run.stderr);
    let growing = ["--filter-set", "growing=on", "--spp", "64", "--slice", "0/2"];
    let run = bench.run(&[&["render", "scene.pbrt", "-o", "x.part"], &growing[..]].concat());
    assert_eq!(run.code, 2);
    assert!(run.stderr.contains("make at most 1;") && run.stderr.contains("growing=off"), "{}", run.stderr);
    let run = bench.run(&["render", "scene.pbrt", "-o", "x.part", "--filter", "talk"]);
    assert_eq!(run.code, 2);
    assert!(run.stderr.contains("talk"), "{}", run.stderr);
}

#[test]
fn a_render_goes_on_from_its_checkpoint_to_the_same_bytes() {
    let bench = bench();
    for filter in ["none", "adaptive"] {
        render(&bench, &["-o", "whole.exr", "--filter", filter]);
        let options = ["--filter", filter, "--checkpoint", "a.checkpoint", "--checkpoint-interval", "1p"];
        // Nothing traces so fast that a microsecond is not over after the first pass.
        render(&bench, &[&["-o", "a.exr", "--time-limit", "0.000001s"], &options[..]].concat());
        assert!(bench.files().contains(&"a.checkpoint".into()));
        assert!(bytes(&bench, "a.exr") != bytes(&bench, "whole.exr"));
        render(&bench, &[&["-o", "a.exr", "--resume", "require"], &options[..]].concat());
        assert!(bytes(&bench, "a.exr") == bytes(&bench, "whole.exr"), "{filter}");
        assert!(!bench.files().contains(&"a.checkpoint".into()), "what is done needs no checkpoint");
        // What is complete is left alone, and what is not is not.
        let before = std::fs::metadata(bench.path("a.exr")).unwrap().modified().unwrap();
        render(&bench, &["-o", "a.exr", "--filter", filter, "--skip-existing"]);
        assert_eq!(std::fs::metadata(bench.path("a.exr")).unwrap().modified().unwrap(), before);
    }
    let run = bench.run(&["render", "scene.pbrt", "-o", "a.exr", "--checkpoint", "none", "--resume", "require"]);
    assert_eq!(run.code, 3);
    assert!(run.stderr.contains("--resume require") && run.stderr.contains("\"none\""), "{}", run.stderr);
}

/// The last epoch may be shorter than the others: it is over with the frame.
#[test]
fn frames_of_any_number_of_samples_merge() {
    let bench = bench();
    for spp in ["9", "6"] {
        bench.succeed(&["render", "scene.pbrt", "--spp", spp, "-o", "whole.exr"]);
        for slice in ["0", "1"] {
            let (name, slice) = (format!("{slice}.part"), format!("{slice}/2"));
            bench.succeed(&["render", "scene.pbrt", "--spp", spp, "-o", &name, "--slice", &slice]);
        }
        bench.succeed(&["merge", "1.part", "0.part", "-o", "merged.exr"]);
        assert!(bytes(&bench, "merged.exr") == bytes(&bench, "whole.exr"), "{spp} samples");
    }
}

/// Within an epoch, and with no checkpoint due before the time was over.
#[test]
fn what_a_limit_of_time_ends_can_be_gone_on_with() {
    for growing in ["growing=off", "growing=on,epoch=100"] {
        what_ends_early_can_be_gone_on_with(growing);
    }
}

fn what_ends_early_can_be_gone_on_with(growing: &str) {
    let bench = bench();
    let job = ["render", "scene.pbrt", "--spp", "2048", "--aov", "all", "--progress", "none", "--filter-set", growing];
    let kept = ["--checkpoint", "a.checkpoint", "-o", "a.exr"];
    let run = bench.succeed(&[&job[..], &kept, &["--time-limit", "0.000001s"]].concat());
    assert!(run.stderr.contains("64 of 2048") && run.stderr.contains("goes on from the checkpoint"), "{}", run.stderr);
    let run = bench.succeed(&[&job[..], &kept, &["--resume", "require"]].concat());
    assert!(run.stderr.contains("samples 0:64 are there"), "{}", run.stderr);
    assert!(!bench.files().contains(&"a.checkpoint".into()));
    bench.succeed(&[&job[..], &["-o", "whole.exr"]].concat());
    assert!(bytes(&bench, "a.exr") == bytes(&bench, "whole.exr"));
}

/// A limit on the size of files stands for a full disk: the system refuses bytes in the middle of a file.
#[test]
fn what_cannot_be_written_is_said_and_loses_nothing() {
    let bench = bench();
    let run = |options: &str| {
        let program = env!("CARGO_BIN_EXE_tessera");
        let job = "render scene.pbrt --spp 8 --resolution 320x200 --filter none --progress none";
        let script = format!("trap '' XFSZ; ulimit -f 64; exec {program} {job} {options}");
        let output =
            std::process::Command::new("sh").args(["-c", &script]).current_dir(bench.path("")).output().unwrap();
        super::Run::of(output)
    };
    bench.write("a.exr", "what was there");
    bench.write("a.part", "what was there");
    for (name, options) in [("a.exr", "-o a.exr --compression none"), ("a.part", "-o a.part")] {
        let run = run(options);
        assert_eq!(run.code, 4, "{}", run.stderr);
        assert!(run.stderr.contains(&format!("{name}: File too large")), "{}", run.stderr);
    }
    assert!(bytes(&bench, "a.exr") == b"what was there" && bytes(&bench, "a.part") == b"what was there");
    let stopped = run("-o b.exr --pixel-bounds 0,64,0,64 --checkpoint b.checkpoint --time-limit 0.000001s");
    assert!(stopped.stderr.contains("stopped early") && !stopped.stderr.contains("goes on from"), "{}", stopped.stderr);
    std::fs::remove_file(bench.path("b.exr")).unwrap();
    // The checkpoint does not fit, the compressed image of a smaller frame does.
    let run = run("-o b.exr --pixel-bounds 0,64,0,64 --checkpoint b.checkpoint --checkpoint-interval 1p");
    assert_eq!(run.code, 0, "{}", run.stderr);
    assert!(run.stderr.contains("no checkpoint") && run.stderr.contains("the render goes on"), "{}", run.stderr);
    assert_eq!(bench.files(), ["a.exr", "a.part", "b.exr", "scene.pbrt"]);
}

#[test]
fn a_checkpoint_of_something_else_is_not_gone_on_with() {
    let bench = bench();
    let checkpoint = ["--checkpoint", "a.checkpoint", "--checkpoint-interval", "1p"];
    render(&bench, &[&["-o", "a.exr", "--time-limit", "0.000001s"], &checkpoint[..]].concat());
    let job = ["render", "scene.pbrt", "-o", "b.exr", "--spp", "16", "--aov", "all", "--checkpoint", "a.checkpoint"];
    let before = bytes(&bench, "a.checkpoint");
    for resume in ["require", "auto"] {
        let words = ["samples per pixel", "\"16\"", "--resume never", "--checkpoint"];
        bench.fail(&[&job[..], &["--quiet", "--resume", resume]].concat(), 3, &words);
        assert!(bytes(&bench, "a.checkpoint") == before && !bench.path("b.exr").exists(), "{resume}");
    }
    bench.succeed(&[&job[..], &["--resume", "never"]].concat());
    assert!(!bench.path("a.checkpoint").exists());
    bench.succeed(&["render", "scene.pbrt", "-o", "c.exr", "--spp", "16", "--aov", "all"]);
    assert!(bytes(&bench, "b.exr") == bytes(&bench, "c.exr"));
    // What is damaged is of no use to anybody.
    std::fs::write(bench.path("a.checkpoint"), &before[..before.len() - 100]).unwrap();
    let whole = ["render", "scene.pbrt", "-o", "a.exr", "--spp", "64", "--aov", "all", "--checkpoint", "a.checkpoint"];
    bench.fail(&[&whole[..], &["--resume", "require"]].concat(), 3, &["a.checkpoint"]);
    let run = bench.succeed(&whole);
    assert!(run.stderr.contains("rendering from the start"), "{}", run.stderr);
}

#[test]
fn a_limit_of_memory_is_kept() {
    let bench = bench();
    let run = bench.run(&["render", "scene.pbrt", "-o", "a.exr", "--resolution", "4000x4000", "--memory-limit", "1G"]);
    assert_eq!(run.code, 1);
    assert!(run.stderr.contains("--memory-limit is 1.00 GB") && run.stderr.contains("--crop"), "{}", run.stderr);
    assert!(!bench.files().contains(&"a.exr".into()));
}
