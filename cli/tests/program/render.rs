//! `tessera render`.

use super::{Bench, Run, SCENE, read};

fn bench() -> Bench {
    let bench = Bench::new();
    bench.write("scene.pbrt", SCENE);
    bench
}

fn bytes(bench: &Bench, name: &str) -> Vec<u8> {
    std::fs::read(bench.path(name)).unwrap()
}

#[test]
fn a_render_writes_the_image_and_nothing_else() {
    let bench = bench();
    let run = bench.succeed(&["render", "scene.pbrt", "-o", "out.exr"]);
    assert_eq!(bench.files(), ["out.exr", "scene.pbrt"]);
    let image = read(&bench.path("out.exr"));
    assert_eq!((image.width, image.height), (48, 32));
    assert_eq!(image.channels, ["R", "G", "B", "A"]);
    assert!(image.pixels.iter().all(|value| value.is_finite()));
    let mean = image.pixels.iter().sum::<f32>() / image.pixels.len() as f32;
    assert!(mean > 0.1, "the image is black: {mean}");
    // Not a terminal: machine lines, the last of them only now that the file is in its place.
    let lines: Vec<_> = run.stdout.lines().collect();
    assert_eq!(lines[0], "ALF_PROGRESS 0%");
    let [image, memory, last] = lines[lines.len() - 3..] else { panic!("{lines:?}") };
    assert_eq!((image, last), ("Image: out.exr", "Finished Rendering"));
    let size = memory.strip_prefix("Peak Memory Usage: ").and_then(|rest| rest.strip_suffix(" GB"));
    assert!(size.is_some_and(|size| size.parse::<f64>().unwrap() > 0.0), "{memory}");
    assert_eq!(lines[lines.len() - 4], "ALF_PROGRESS 100%");
    assert!(run.stderr.contains("wrote out.exr: 48 x 32 pixels, 4 samples each"), "{}", run.stderr);
}

#[test]
fn the_same_job_gives_the_same_bytes_on_any_number_of_threads() {
    let bench = bench();
    let mut files = Vec::new();
    for filter in ["none", "talk", "adaptive"] {
        let render = |threads: &str, seed: &str| {
            let job = ["render", "scene.pbrt", "-o", "a.exr", "--aov", "all", "--progress", "none"];
            bench.succeed(&[&job[..], &["-t", threads, "--seed", seed, "--filter", filter]].concat());
            bytes(&bench, "a.exr")
        };
        let one = render("1", "0");
        assert!(one == render("2", "0") && one == render("3", "0"), "{filter}");
        assert!(one != render("1", "77"), "{filter}");
        files.push(one);
    }
    assert!(files[0] != files[1] && files[1] != files[2] && files[2] != files[0]);
    bench.succeed(&["render", "scene.pbrt", "-o", "a.exr", "--aov", "all", "--seed", "0"]);
    assert!(bytes(&bench, "a.exr") == files[2], "the default is not the adaptive filter");
}

#[test]
fn no_file_is_written_over_another() {
    let bench = bench();
    for options in [["--checkpoint", "a.exr"], ["--checkpoint", "./a.exr"], ["--stats", "a.exr"]] {
        let run = bench.run(&[&["render", "scene.pbrt", "-o", "a.exr"], &options[..]].concat());
        assert!(run.code == 2 && run.stderr.contains("name two files"), "{options:?}: {}", run.stderr);
    }
    // A checkpoint is deleted when the picture is there.
    let run = bench.run(&["render", "scene.pbrt", "-o", "a.exr", "--checkpoint", "scene.pbrt"]);
    assert!(run.code == 3 && run.stderr.contains("a file of its own"), "{}", run.stderr);
    assert_eq!((bench.files(), bytes(&bench, "scene.pbrt")), (vec!["scene.pbrt".to_owned()], SCENE.into()));
}

#[test]
fn crops_are_the_same_pixels_in_a_window_of_the_frame() {
    let bench = bench();
    // Filtered, pixels within the window would have no neighbours beyond it.
    let render = |window: &[&str], name: &str| {
        bench.succeed(&[&["render", "scene.pbrt", "--filter", "none", "-o", name], window].concat());
    };
    render(&[], "full.exr");
    render(&["--crop", "0.25,0.75,0.5,1"], "crop.exr");
    render(&["--pixel-bounds", "12,36,16,32"], "bounds.exr");
    let (full, crop, bounds) =
        (read(&bench.path("full.exr")), read(&bench.path("crop.exr")), read(&bench.path("bounds.exr")));
    assert_eq!(crop.pixels, bounds.pixels);
    assert_eq!((crop.data_window.x, crop.data_window.y, crop.width, crop.height), (12, 16, 24, 16));
    assert_eq!(crop.display_window, full.display_window);
    let channels = full.channels.len();
    for y in 0..16 {
        let row = &full.pixels[((y + 16) * 48 + 12) * channels..][..24 * channels];
        assert_eq!(row, &crop.pixels[y * 24 * channels..][..24 * channels], "row {y}");
    }
}

#[test]
fn overscan_adds_pixels_around_the_frame_and_changes_none_in_it() {
    let bench = bench();
    let render = |window: &[&str], name: &str| {
        bench.succeed(&[&["render", "scene.pbrt", "--filter", "none", "-o", name], window].concat());
        read(&bench.path(name))
    };
    let (full, wide) = (render(&[], "full.exr"), render(&["--overscan", "5"], "wide.exr"));
    assert_eq!((wide.data_window.x, wide.data_window.y, wide.width, wide.height), (-5, -5, 58, 42));
    assert_eq!(wide.display_window, full.display_window);
    let channels = full.channels.len();
    for y in 0..32 {
        let row = &wide.pixels[((y + 5) * 58 + 5) * channels..][..48 * channels];
        assert_eq!(row, &full.pixels[y * 48 * channels..][..48 * channels], "row {y}");
    }
    // A part of it, by way of a part.
    let bounds = ["--overscan", "5", "--pixel-bounds", "-5,3,-9,2"];
    let corner = render(&bounds, "corner.exr");
    assert_eq!((corner.data_window.x, corner.data_window.y, corner.width, corner.height), (-5, -5, 8, 7));
    assert_eq!(corner.pixels[..8 * channels], wide.pixels[..8 * channels]);
    bench.succeed(&[&["render", "scene.pbrt", "--filter", "none", "-o", "corner.part"], &bounds[..]].concat());
    bench.succeed(&["merge", "corner.part", "-o", "merged.exr"]);
    assert!(bytes(&bench, "merged.exr") == bytes(&bench, "corner.exr"));
}

#[test]
fn files_are_where_the_path_map_says() {
    let bench = bench();
    bench.succeed(&["render", "scene.pbrt", "-o", "one.exr"]);
    std::fs::create_dir(bench.path("here")).unwrap();
    std::fs::copy(bench.path("scene.pbrt"), bench.path("here/all.pbrt")).unwrap();
    bench.write("from windows.pbrt", "Include \"P:/show/all.pbrt\"");
    bench.write("mapped.pbrt", "Include \"/nowhere/show/all.pbrt\"");
    bench.fail(&["render", "mapped.pbrt", "-o", "two.exr"], 3, &["/nowhere/show/all.pbrt"]);
    let here = bench.path("here");
    let rules = format!("/nowhere/show={}", here.display());
    bench.succeed(&["render", "mapped.pbrt", "-o", "two.exr", "--path-map", &rules]);
    let rules = serde_json::json!({ "version": "pathmapping-1.0", "path_mapping_rules": [
        { "source_path_format": "WINDOWS", "source_path": "p:\\show", "destination_path": here } ] });
    bench.write("rules.json", &rules.to_string());
    bench.succeed(&["render", "from windows.pbrt", "-o", "three.exr", "--path-map", "rules.json"]);
    let pixels = |name: &str| read(&bench.path(name)).pixels;
    assert!(pixels("two.exr") == pixels("one.exr") && pixels("three.exr") == pixels("one.exr"));
}

#[test]
fn metadata_says_what_was_rendered_and_no_more() {
    let bench = bench();
    bench.succeed(&["render", "scene.pbrt", "-o", "a.exr", "--spp", "8", "--sample-range", "2:5", "--seed", "9"]);
    let image = read(&bench.path("a.exr"));
    let text = |key: &str| match image.attribute(key) {
        Some(oiio::Attribute::Text(text)) => text.clone(),
        other => panic!("{key}: {other:?}"),
    };
    assert_eq!(text("tessera/sampleRange"), "2:5");
    assert_eq!(text("tessera/seed"), "9");
    assert_eq!(text("DateTime"), "1970:01:01 00:00:00");
    assert_eq!(text("tessera/sceneHash").len(), 16);
    assert_eq!(image.attribute("tessera/complete"), Some(&oiio::Attribute::Int(1)));
    assert_eq!(image.attribute("samplesPerPixel"), Some(&oiio::Attribute::Int(3)));
    for private in ["HostComputer", "renderTimeSeconds", "tessera/peakRSS", "tessera/threads"] {
        assert_eq!(image.attribute(private), None, "{private}");
    }
    // Slices of one picture share the hash of its settings; another size does not.
    let settings = text("tessera/settingsHash");
    bench.succeed(&["render", "scene.pbrt", "-o", "b.exr", "--sample-range", "5:8", "--seed", "9"]);
    bench.succeed(&["render", "scene.pbrt", "-o", "c.exr", "--seed", "9", "--resolution", "24x16"]);
    let hash = |name: &str| read(&bench.path(name)).attribute("tessera/settingsHash").cloned();
    assert_eq!(hash("b.exr"), Some(oiio::Attribute::Text(settings.clone())));
    assert_ne!(hash("c.exr"), Some(oiio::Attribute::Text(settings.clone())));
    // Nor does another filter, or another setting of it.
    assert!(text("tessera/filter").starts_with("adaptive trees="), "{}", text("tessera/filter"));
    for change in [["--filter", "none"], ["--filter-set", "trees=3"]] {
        let job = ["render", "scene.pbrt", "-o", "d.exr", "--sample-range", "5:8", "--seed", "9"];
        bench.succeed(&[&job[..], &change].concat());
        assert_ne!(hash("d.exr"), Some(oiio::Attribute::Text(settings.clone())), "{change:?}");
    }
}

#[test]
fn each_filter_says_what_it_did() {
    let bench = bench();
    let render = |filter: &str, word: &str| {
        let run = bench.succeed(&["render", "scene.pbrt", "-o", "a.exr", "--filter", filter, "--stats", "s.json"]);
        assert!(run.stderr.contains(word), "{}", run.stderr);
        let stats: serde_json::Value = serde_json::from_slice(&bytes(&bench, "s.json")).unwrap();
        stats["filter"].clone()
    };
    assert!(render("none", "wrote a.exr").is_null());
    let [talk, adaptive] = [render("talk", "% unresolved"), render("adaptive", "pairs of pixel and cell")];
    for filter in [&talk, &adaptive] {
        // Half the picture shows the sky, which has no vertex.
        let paths = filter["paths"].as_u64().unwrap();
        assert!((48 * 32..48 * 32 * 4).contains(&paths), "{filter}");
        assert!(filter["cells"].as_u64().unwrap() > 10 && filter["bytes"].as_u64().unwrap() > 1000, "{filter}");
        assert!(filter["seconds"].as_f64().unwrap() > 0.0 && filter["share"].as_f64().unwrap() < 1.0, "{filter}");
        assert!(filter["unfiltered"].as_u64().unwrap() <= paths / 100, "{filter}");
    }
    assert_eq!((&talk["name"], &adaptive["name"]), (&"talk".into(), &"adaptive".into()));
    assert!(adaptive["pairs"].as_u64().unwrap() > 1000, "{adaptive}");
    let probes: u64 = talk["probes"].as_array().unwrap().iter().map(|cells| cells.as_u64().unwrap()).sum();
    assert_eq!(Some(probes), talk["cells"].as_u64());
    assert!(talk["occupancy"].as_f64().unwrap() > 0.0 && talk["unresolved_share"] == 0.0, "{talk}");
}

#[test]
fn provenance_and_the_date_are_recorded_when_asked_for() {
    let bench = bench();
    bench.succeed(&["render", "scene.pbrt", "-o", "a.exr", "--provenance"]);
    let image = read(&bench.path("a.exr"));
    for key in ["HostComputer", "renderTimeSeconds", "tessera/peakRSS", "tessera/threads"] {
        assert!(image.attribute(key).is_some(), "{key}");
    }
    assert_ne!(image.attribute("DateTime"), Some(&oiio::Attribute::Text("1970:01:01 00:00:00".into())));
    let dated = bench.command(&["render", "scene.pbrt", "-o", "b.exr"]).env("SOURCE_DATE_EPOCH", "951782400").output();
    assert_eq!(Run::of(dated.unwrap()).code, 0);
    let date = oiio::Attribute::Text("2000:02:29 00:00:00".into());
    assert_eq!(read(&bench.path("b.exr")).attribute("DateTime"), Some(&date));
}

#[test]
fn frame_numbers_go_into_all_names() {
    let bench = bench();
    bench.succeed(&["render", "scene.pbrt", "-o", "a.####.exr", "--frame", "12", "--stats", "a.%03d.json"]);
    assert_eq!(bench.files(), ["a.0012.exr", "a.012.json", "scene.pbrt"]);
    let stats: serde_json::Value = serde_json::from_slice(&bytes(&bench, "a.012.json")).unwrap();
    assert_eq!((&stats["frame"], &stats["output"]), (&12.into(), &"a.0012.exr".into()));
    assert_eq!(stats["complete"], true);
    assert_eq!(stats["samples"], serde_json::json!([0, 4]));
    assert_eq!(stats["rays"]["camera"], 48 * 32 * 4);
    assert_eq!(stats["problems"]["rejected_samples"], 0);
    assert!(stats["seconds"]["total"].as_f64().unwrap() > 0.0);
    assert!(stats["memory"]["peak_resident_bytes"].as_u64().unwrap() > 1 << 20);
}

#[test]
fn each_kind_of_progress_keeps_to_its_stream() {
    let bench = bench();
    let render = |kind: &str| bench.succeed(&["render", "scene.pbrt", "-o", "a.exr", "--progress", kind]);
    assert_eq!(render("none").stdout, "");
    assert_eq!(render("bar").stdout, "");
    let openjd = render("openjd").stdout;
    assert!(openjd.lines().all(|line| line.starts_with("openjd_")), "{openjd}");
    assert_eq!(openjd.lines().last(), Some("openjd_progress: 100.0"));
    let events: Vec<serde_json::Value> =
        render("json").stdout.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let names: Vec<_> = events.iter().map(|event| event["event"].as_str().unwrap()).collect();
    assert_eq!(names.last(), Some(&"finished"));
    assert_eq!(names[names.len() - 2], "image");
    let percents: Vec<f64> = events.iter().filter_map(|event| event["percent"].as_f64()).collect();
    assert!(percents.is_sorted() && percents.last() == Some(&100.0), "{percents:?}");
}

#[test]
fn slurm_decides_the_threads_unless_the_command_line_does() {
    let bench = bench();
    let threads = |arguments: &[&str]| {
        let mut command = bench.command(&["render", "scene.pbrt", "-o", "a.exr", "--stats", "s.json"]);
        let output = command.args(arguments).env("SLURM_CPUS_PER_TASK", "3").output().unwrap();
        assert_eq!(Run::of(output).code, 0);
        serde_json::from_slice::<serde_json::Value>(&bytes(&bench, "s.json")).unwrap()["threads"].as_u64()
    };
    assert_eq!(threads(&[]), Some(3));
    assert_eq!(threads(&["--threads", "2"]), Some(2));
}

#[test]
fn a_time_limit_ends_a_long_render_early_and_says_so() {
    let bench = bench();
    let run = bench.succeed(&["render", "scene.pbrt", "-o", "a.exr", "--spp", "100000000", "--time-limit", "0.2s"]);
    assert!(run.stderr.contains("stopped early"), "{}", run.stderr);
    assert!(run.stdout.contains("ALF_PROGRESS 100%"), "{}", run.stdout);
    let image = read(&bench.path("a.exr"));
    assert_eq!(image.attribute("tessera/complete"), Some(&oiio::Attribute::Int(0)));
    let samples = image.attribute("samplesPerPixel");
    assert!(matches!(samples, Some(oiio::Attribute::Int(1..100_000_000))), "{samples:?}");
}

/// Starts a render that would take hours, waits until it traces, and sends it `signal`.
fn interrupt(bench: &Bench, signal: &str) -> Run {
    use std::io::{BufRead, BufReader, Read};
    use std::process::{Command, Stdio};
    let arguments = ["render", "scene.pbrt", "-o", "a.exr", "--spp", "8000000", "--progress", "alf"];
    let mut command = bench.command(&arguments);
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut stdout = BufReader::new(child.stdout.take().unwrap());
    let mut line = String::new();
    stdout.read_line(&mut line).unwrap();
    assert_eq!(line, "ALF_PROGRESS 0%\n");
    assert!(Command::new("kill").args(["-s", signal, &child.id().to_string()]).status().unwrap().success());
    stdout.read_to_string(&mut line).unwrap();
    let output = child.wait_with_output().unwrap();
    Run { stdout: line, ..Run::of(output) }
}

#[test]
fn a_signal_ends_the_render_with_an_image_and_a_code_of_its_own() {
    for signal in ["TERM", "INT"] {
        let bench = bench();
        let run = interrupt(&bench, signal);
        assert_eq!(run.code, 75, "{}", run.stderr);
        assert!(run.stderr.contains("stopped early") && run.stderr.contains("interrupted"), "{}", run.stderr);
        assert!(!run.stdout.contains("100%") && !run.stdout.contains("Finished"), "{}", run.stdout);
        assert_eq!(bench.files(), ["a.exr", "scene.pbrt"]);
        let image = read(&bench.path("a.exr"));
        assert_eq!(image.attribute("tessera/complete"), Some(&oiio::Attribute::Int(0)));
    }
}

#[test]
fn a_wrong_scene_exits_with_3_shows_every_error_and_leaves_the_old_image() {
    let bench = bench();
    bench.write("a.exr", "old");
    bench.write("wrong.pbrt", "Camera \"perspective\"\nWorldBegin\nShape \"cone\"\nMaterial \"mud\"\n");
    let run =
        bench.fail(&["render", "wrong.pbrt", "-o", "a.exr"], 3, &["wrong.pbrt:3:", "cone", "wrong.pbrt:4:", "mud"]);
    assert!(!run.stdout.contains("100%") && !run.stdout.contains("Finished"), "{}", run.stdout);
    assert_eq!(bytes(&bench, "a.exr"), b"old");
    let run = bench.run(&["render", "wrong.pbrt", "-o", "a.exr", "--progress", "openjd"]);
    assert!(run.stdout.lines().any(|line| line.starts_with("openjd_fail: ")), "{}", run.stdout);
    let run = bench.run(&["render", "wrong.pbrt", "-o", "a.exr", "--progress", "json"]);
    let last: serde_json::Value = serde_json::from_str(run.stdout.lines().last().unwrap()).unwrap();
    assert_eq!((&last["event"], &last["exit_code"]), (&"failed".into(), &3.into()));
}

#[test]
fn names_in_a_scene_cannot_forge_progress() {
    let bench = bench();
    let forged = "Material \"diffuse\" \"float ALF_PROGRESS 99% openjd_fail: Finished Rendering\" 1\nWorldBegin\n";
    bench.write("forged.pbrt", &format!("{forged}{SCENE}"));
    let run = bench.run(&["render", "forged.pbrt", "-o", "a.exr", "-v"]);
    for word in ["ALF_PROGRESS 99%", "openjd_fail", "Finished Rendering"] {
        assert!(!run.stderr.contains(word), "{}", run.stderr);
    }
}

/// Cells are chosen by the samples that there are, not by the most that there may be.
#[test]
fn a_frame_that_ends_at_a_target_does_not_depend_on_the_most_samples() {
    let bench = Bench::new();
    bench.write("scene.pbrt", SCENE);
    let render = |options: &[&str]| bench.succeed(&[&["render", "scene.pbrt", "--progress", "none"], options].concat());
    for spp in ["100", "4096"] {
        render(&["--target-error", "0.02", "--spp", spp, "-o", &format!("{spp}.exr")]);
    }
    let [few, many] = ["100.exr", "4096.exr"].map(|name| read(&bench.path(name)));
    assert!(few.pixels == many.pixels);
    let Some(oiio::Attribute::Int(samples)) = many.attribute("samplesPerPixel") else { panic!("no number of samples") };
    assert!(*samples < 100, "{samples}");
    let range = format!("0:{samples}");
    render(&["--sample-range", &range, "--spp", "4096", "--filter-set", "growing=on", "-o", "range.exr"]);
    assert!(read(&bench.path("range.exr")).pixels == many.pixels);
    // Who says otherwise is heeded.
    let told = ["--target-error", "0.02", "--spp", "4096", "--filter-set", "growing=off", "-o", "off.exr"];
    render(&told);
    assert!(read(&bench.path("off.exr")).pixels != many.pixels);
}

#[test]
fn a_render_knows_its_error_and_stops_at_a_target() {
    let bench = Bench::new();
    bench.write("scene.pbrt", SCENE);
    let stats = |name: &str| -> serde_json::Value {
        serde_json::from_str(&std::fs::read_to_string(bench.path(name)).unwrap()).unwrap()
    };
    bench.succeed(&["render", "scene.pbrt", "-o", "a.exr", "--spp", "8", "--filter", "none", "--stats", "a.json"]);
    for (filter, target) in [("none", "0.01"), ("adaptive", "0.02")] {
        let args =
            ["--filter", filter, "--target-error", target, "--spp", "4096", "--aov", "error", "--stats", "b.json"];
        let run = bench.succeed(&[&["render", "scene.pbrt", "-o", "b.exr"], &args[..]].concat());
        let found = stats("b.json");
        let estimate = found["error"]["relmse"].as_f64().unwrap();
        assert!(found["goal_reached"] == true && found["samples"][1].as_u64().unwrap() < 4096, "{found}");
        assert!(estimate > 0.0 && estimate <= target.parse().unwrap(), "{found}");
        assert!(run.stderr.contains("estimated relMSE") && run.stderr.contains("good enough"), "{}", run.stderr);
        let image = read(&bench.path("b.exr"));
        let error = image.channel("error.G").unwrap();
        let known = image.pixels.chunks_exact(image.channels.len()).filter(|pixel| pixel[error] > 0.0).count();
        assert!(known > image.width * image.height / 2, "{known}");
    }
    // Without a filter the estimate costs nothing and is always there.
    assert!(stats("a.json")["error"]["interval"][1].as_f64().unwrap() > 0.0);
}

/// The figures of `--stats`.
fn stats(bench: &Bench, name: &str) -> serde_json::Value {
    serde_json::from_slice(&bytes(bench, name)).unwrap()
}

/// Rays of a second are those that this run traced, and no time is counted twice.
#[test]
fn a_resumed_render_counts_what_it_did_itself() {
    let bench = bench();
    let job =
        ["render", "scene.pbrt", "-o", "a.exr", "--spp", "256", "--stats", "a.json", "--checkpoint", "a.checkpoint"];
    bench.succeed(&[&job[..], &["--time-limit", "0.000001s"]].concat());
    let first = stats(&bench, "a.json");
    bench.succeed(&[&job[..], &["--resume", "require"]].concat());
    let all = stats(&bench, "a.json");
    let rays = |stats: &serde_json::Value| {
        ["closest_hit", "shadow"].iter().map(|kind| stats["rays"][*kind].as_f64().unwrap()).sum::<f64>()
    };
    for (stats, traced) in [(&first, rays(&first)), (&all, rays(&all) - rays(&first))] {
        let seconds = |phase: &str| stats["seconds"][phase].as_f64().unwrap();
        let told = stats["rays"]["per_second"].as_f64().unwrap() * seconds("render");
        assert!((told / traced - 1.0).abs() < 1e-9, "{told} of {traced}");
        let phases: f64 = ["parse", "compile", "render", "write"].into_iter().map(seconds).sum();
        assert!(phases <= seconds("total"), "{stats}");
    }
}

#[test]
fn a_goal_that_is_missed_is_told() {
    let bench = bench();
    for (filter, goal, words) in [
        ("adaptive", ["--target-error", "0.0001"], "the target 1.00e-4 of the relMSE"),
        ("none", ["--noise-threshold", "0.0001"], "the target 1.00e-4 of the noise"),
    ] {
        let job = ["render", "scene.pbrt", "-o", "a.exr", "--spp", "16", "--filter", filter];
        let run = bench.succeed(&[&job[..], &goal].concat());
        assert!(run.stderr.contains(words) && run.stderr.contains("16 samples were taken"), "{}", run.stderr);
    }
    let run = bench.succeed(&["render", "scene.pbrt", "-o", "a.exr", "--target-error", "10", "--spp", "16"]);
    assert!(!run.stderr.contains("not reached"), "{}", run.stderr);
    let run = bench.succeed(&["render", "scene.pbrt", "-o", "a.exr", "--spp", "1", "--threads", "1"]);
    assert!(run.stderr.contains("1 sample each") && run.stderr.contains("on 1 thread;"), "{}", run.stderr);
}

#[test]
fn a_scene_without_light_and_channels_without_filter_are_told() {
    let bench = bench();
    let dark: String =
        SCENE.lines().filter(|line| !line.contains("LightSource")).map(|line| format!("{line}\n")).collect();
    bench.write("dark.pbrt", &dark);
    let said = |scene: &str, options: &[&str], words: &str| {
        let run = bench.succeed(&[&["render", scene, "-o", "a.exr"], options].concat());
        run.stderr.matches(words).count()
    };
    assert_eq!(said("dark.pbrt", &[], "there is no light"), 1);
    assert_eq!(said("scene.pbrt", &[], "there is no light"), 0);
    let unfiltered = "direct, light are not";
    let (light, other) = (["--aov", "light,albedo,direct"], ["--aov", "albedo"]);
    assert_eq!(said("scene.pbrt", &light, unfiltered), 1);
    assert_eq!(said("scene.pbrt", &other, "filtered,"), 0);
    assert_eq!(said("scene.pbrt", &[&light[..], &["--filter", "none"]].concat(), unfiltered), 0);
}

#[test]
fn what_cannot_be_is_answered_by_what_can() {
    let bench = bench();
    let render = ["render", "scene.pbrt", "-o", "a.exr"];
    bench.fail(&[&render[..], &["--denoise"]].concat(), 2, &["tessera denoise"]);
    bench.fail(&[&render[..], &["--memory-limit", "1M"]].concat(), 1, &["--memory-limit is 1.0 MB"]);
    bench.fail(&[&render[..], &["--filter-set", "cells=2"]].concat(), 2, &["cells", "--filter-set help"]);
    bench.succeed(&["render", "--filter-set", "help"]);
    let slice = ["render", "scene.pbrt", "-o", "a.part", "--spp", "32", "--slice", "0/2"];
    bench.fail(&[&slice[..], &["--time-limit", "1s"]].concat(), 2, &["--time-limit", "gap", "--checkpoint"]);
    bench.fail(&[&slice[..], &["--target-error", "1"]].concat(), 2, &["--target-error", "gap"]);
    bench.succeed(&[&slice[..], &["--time-limit", "1h", "--checkpoint", "a.checkpoint"]].concat());
}

#[test]
fn a_material_that_nobody_named_is_the_default() {
    let bench = bench();
    bench.write("scene.pbrt", &SCENE.replace("Material", "# Material"));
    bench.succeed(&["render", "scene.pbrt", "-o", "a.exr", "--aov", "CryptoMaterial"]);
    let image = String::from_utf8_lossy(&bytes(&bench, "a.exr")).into_owned();
    assert!(image.contains("{\"default\":"), "no material \"default\" in the manifest");
}

#[test]
fn all_layers_take_a_format_but_those_that_are_named_another() {
    let bench = bench();
    let job = ["render", "scene.pbrt", "-o", "a.exr", "--aov", "albedo,depth,CryptoObject"];
    let size = |options: &[&str]| {
        bench.succeed(&[&job[..], &["--compression", "none"], options].concat());
        bytes(&bench, "a.exr").len()
    };
    let usual = size(&[]);
    // Bytes of 48 x 32 pixels: three channels of albedo and one of depth in 2 for 4, four of rgba in 4 for 2.
    let pixels = 48 * 32;
    assert_eq!(usual - size(&["--half", "all"]), 2 * 4 * pixels);
    assert_eq!(usual - size(&["--half", "all", "--float", "depth"]), 2 * 3 * pixels);
    assert_eq!(size(&["--float", "all"]) - usual, 2 * 4 * pixels);
}
