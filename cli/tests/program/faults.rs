//! Processes that are killed at random moments, and the frames that come of it all the same.

use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use super::{Bench, SCENE};

/// Moments that are tried unless TESSERA_FAULTS says otherwise, as `ci/test-faults` does.
const MOMENTS: usize = 10;

const RENDER: [&str; 14] = [
    "render",
    "scene.pbrt",
    "-o",
    "frame.exr",
    "--spp",
    "64",
    "--resolution",
    "96x64",
    "--checkpoint",
    "frame.checkpoint",
    "--checkpoint-interval",
    "1p",
    "--progress",
    "none",
];

/// How a process is ended.
#[derive(Clone, Copy, Debug, PartialEq)]
enum End {
    Kill,
    Terminate,
    /// The second signal comes while the first is being answered.
    TerminateTwice,
}

/// What was seen over all moments.
#[derive(Debug, Default)]
struct Figures {
    killed: usize,
    terminated: usize,
    /// Ended before the signal came.
    too_late: usize,
    /// Ends that left a checkpoint to go on from.
    resumed: usize,
    partial_images: usize,
    /// Left by ends.
    hidden_files: usize,
    /// Still there when the next run was done.
    hidden_files_left: usize,
    broken_files: usize,
    frames: usize,
    differing_frames: usize,
}

/// SplitMix64.
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        mixed ^ (mixed >> 31)
    }

    /// In [0, 1).
    fn uniform(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }
}

fn start(bench: &Bench, resume: &str) -> Child {
    let mut command = bench.command(&[&RENDER[..], &["--quiet", "--resume", resume]].concat());
    command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap()
}

fn signal(child: &Child, name: &str) {
    // It may have ended in between, but not been waited for, so the number is still its own.
    Command::new("kill").args(["-s", name, &child.id().to_string()]).status().unwrap();
}

/// Ends a render at a moment; its exit code, if it has one.
fn end_at(bench: &Bench, end: End, moment: Duration, resume: &str) -> Option<i32> {
    let mut child = start(bench, resume);
    std::thread::sleep(moment);
    signal(&child, if end == End::Kill { "KILL" } else { "TERM" });
    if end == End::TerminateTwice {
        std::thread::sleep(Duration::from_millis(5));
        signal(&child, "TERM");
    }
    child.wait().unwrap().code()
}

/// Number of hidden files.
fn hidden(bench: &Bench) -> usize {
    bench.files().iter().filter(|name| name.starts_with('.')).count()
}

impl Figures {
    /// Looks at what an end has left. Whether there is a checkpoint: it is read by the next run, which requires it.
    fn inspect(&mut self, bench: &Bench, code: Option<i32>) -> bool {
        let (image, checkpoint) = (bench.path("frame.exr"), bench.path("frame.checkpoint"));
        if image.exists() {
            let whole = oiio::read(&image).is_ok_and(|image| image.attribute("tessera/complete").is_some());
            self.broken_files += usize::from(!whole);
            self.partial_images += usize::from(whole && code != Some(0));
        } else if code == Some(0) {
            self.broken_files += 1;
        }
        self.hidden_files += hidden(bench);
        checkpoint.exists()
    }
}

/// At any moment a process may be killed or told to stop, again and again: no file under a final name is broken, what is left
/// can be gone on with, and the frame in the end has the bytes of one that nobody disturbed.
#[test]
fn whenever_a_render_is_ended_the_frame_comes_out_the_same() {
    let moments = std::env::var("TESSERA_FAULTS").map_or(MOMENTS, |text| text.parse().expect("a number"));
    let bench = Bench::new();
    bench.write("scene.pbrt", SCENE);
    let begin = Instant::now();
    assert!(start(&bench, "never").wait().unwrap().success());
    let whole = begin.elapsed();
    let expected = std::fs::read(bench.path("frame.exr")).unwrap();

    let (mut numbers, mut figures) = (Numbers(1), Figures::default());
    let mut tried = 0;
    while tried < moments {
        std::fs::remove_file(bench.path("frame.exr")).unwrap();
        let mut resume = "auto";
        loop {
            let end = [End::Kill, End::Kill, End::Terminate, End::TerminateTwice][(numbers.next() >> 62) as usize];
            let code = end_at(&bench, end, whole.mul_f64(numbers.uniform()), resume);
            tried += 1;
            match (code, end) {
                (Some(0), _) => figures.too_late += 1,
                (None, End::Kill) => figures.killed += 1,
                // Before the program listens to signals they end it as they end any other.
                (None | Some(75), End::Terminate | End::TerminateTwice) => figures.terminated += 1,
                other => panic!("{other:?} with --resume {resume}"),
            }
            let stored = figures.inspect(&bench, code);
            figures.resumed += usize::from(stored);
            resume = if stored { "require" } else { "auto" };
            if tried >= moments || numbers.uniform() < 0.5 {
                break;
            }
        }
        let run = bench.run(&[&RENDER[..], &["--resume", resume]].concat());
        assert_eq!(run.code, 0, "{}", run.stderr);
        figures.frames += 1;
        figures.hidden_files_left += hidden(&bench);
        figures.differing_frames += usize::from(std::fs::read(bench.path("frame.exr")).unwrap() != expected);
        assert!(!bench.path("frame.checkpoint").exists(), "a checkpoint of what is complete");
    }
    #[allow(clippy::print_stdout, reason = "the figures of the campaign")]
    {
        println!("{tried} moments within {:.2} s each: {figures:#?}", whole.as_secs_f64());
    }
    let faults = (figures.broken_files, figures.differing_frames, figures.hidden_files_left);
    assert_eq!(faults, (0, 0, 0), "{figures:#?}");
    assert!(figures.killed > 0 && figures.terminated > 0 && figures.resumed > 0, "no moment was tried: {figures:#?}");
}
