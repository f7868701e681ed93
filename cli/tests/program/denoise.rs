//! `tessera denoise`, with a program in Open Image Denoise's place that notes what it is asked for and copies its input.

use std::os::unix::fs::PermissionsExt;

use super::{Bench, read};

const STAND_IN: &str =
    "#!/bin/sh\necho \"$1 $5 $7 $9\" >>asked\ncp \"$2\" \"$(echo \"$*\" | sed 's/.*-o \\([^ ]*\\).*/\\1/')\"\n";

fn bench() -> Bench {
    let bench = Bench::new();
    bench.write("oidnDenoise", STAND_IN);
    let executable = std::fs::Permissions::from_mode(0o755);
    std::fs::set_permissions(bench.path("oidnDenoise"), executable).unwrap();
    bench
}

#[test]
fn the_picture_comes_back_beside_the_noisy_one_and_guided_by_what_it_has() {
    let bench = bench();
    bench.write_image("a.exr", 3, 2, |x, y| [x as f32, y as f32, 0.5]);
    // A name alone is of this folder too, not of the PATH.
    let denoise = |name: &str| ["denoise", name, "-o", "clean.exr", "--oidn", "oidnDenoise"].map(str::to_owned);
    let run = bench.succeed(&denoise("a.exr").each_ref().map(String::as_str));
    assert!(run.stderr.contains("denoise.albedo"), "{}", run.stderr);
    let (noisy, clean) = (read(&bench.path("a.exr")), read(&bench.path("clean.exr")));
    assert_eq!(noisy.pixels, clean.pixels);
    assert_eq!(std::fs::read_to_string(bench.path("asked")).unwrap().lines().count(), 1);

    let channels = ["R", "G", "B", "albedo.R", "albedo.G", "albedo.B", "N.X", "N.Y", "N.Z"];
    bench.write_channels("b.exr", [3, 2], &channels, |x, _| vec![x as f32; 9]);
    std::fs::remove_file(bench.path("asked")).unwrap();
    bench.succeed(&denoise("b.exr").each_ref().map(String::as_str));
    let asked = std::fs::read_to_string(bench.path("asked")).unwrap();
    let flags: Vec<&str> = asked.lines().filter_map(|line| line.split(' ').next()).collect();
    assert_eq!(flags, ["--alb", "--nrm", "--hdr"]);
    assert!(asked.contains("--nrm") && asked.contains("--clean_aux"), "{asked}");
}

#[test]
fn what_cannot_be_denoised_is_said_and_nothing_is_touched() {
    let bench = bench();
    bench.write_image("a.exr", 2, 2, |_, _| [1.0; 3]);
    bench.fail(&["denoise", "a.exr", "-o", "./a.exr"], 2, &["name another output"]);
    bench.fail(&["denoise", "a.exr", "-o", "b.exr", "--oidn", "none"], 3, &["pyoidn", "OIDN_DENOISE"]);
    bench.write("oidnDenoise", "#!/bin/sh\necho 'Error: no device' >&2\nexit 1\n");
    bench.fail(&["denoise", "a.exr", "-o", "b.exr", "--oidn", "./oidnDenoise"], 1, &["no device"]);
    bench.write_channels("z.exr", [2, 2], &["Z"], |_, _| vec![1.0]);
    bench.fail(&["denoise", "z.exr", "-o", "b.exr", "--oidn", "./oidnDenoise"], 3, &["R, G and B"]);
    assert_eq!(bench.files(), ["a.exr", "oidnDenoise", "z.exr"]);
}
