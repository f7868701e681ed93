//! Scenes of random directives with strange numbers: each a finite frame, or refused at a line.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use tests::strange::{Folder, Outcome, scene};

use super::support::size;

/// SplitMix64 \[Steele14\].
fn random(index: u64) -> u64 {
    let mut z = index.wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ z >> 31
}

/// The bytes of a scene: 20 to 275.
fn bytes(index: u64) -> Vec<u8> {
    let count = 20 + (random(index << 16) & 255);
    (1..=count).map(|i| random((index << 16) + i) as u8).collect()
}

/// What becomes of a scene; a panic of the renderer is wrong as well.
fn judge(folder: &Folder, name: &str, text: &str) -> Result<Outcome, String> {
    let judged = catch_unwind(AssertUnwindSafe(|| folder.judge(text)));
    let wrong = match judged {
        Ok(Ok(outcome)) => return Ok(outcome),
        Ok(Err(wrong)) => wrong.0,
        Err(_) => "panicked".into(),
    };
    Err(format!("{name}: {wrong}\n{text}"))
}

/// The `count` scenes from the one of this number on, none of which may be wrong.
fn all(first: u64, count: u64) {
    let folder = Folder::new();
    let [mut rendered, mut rejected, mut refused] = [0, 0, 0];
    let mut wrong = Vec::new();
    for index in first..first + count {
        match judge(&folder, &format!("scene {index}"), &scene(&bytes(index))) {
            Ok(Outcome::Rendered) => rendered += 1,
            Ok(Outcome::Rejected(_)) => rejected += 1,
            Ok(Outcome::Refused) => refused += 1,
            Err(why) => wrong.push(why),
        }
    }
    println!("{count} scenes: {rendered} rendered, {rejected} with rejected samples, {refused} refused");
    assert!(wrong.is_empty(), "{} are wrong:\n{}", wrong.len(), wrong.join("\n"));
    assert!(2 * rendered > count, "most scenes are to be rendered");
}

#[test]
fn random_scenes_are_finite_frames_or_refused() {
    all(0, u64::from(size("TESSERA_STRANGE_SCENES", 300)));
}

#[test]
fn strange_scenes_that_once_were_wrong_are_right() {
    let folder = Folder::new();
    let kept = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/regressions/frame");
    let mut paths: Vec<_> = std::fs::read_dir(kept).unwrap().map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    for path in paths {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        let outcome = judge(&folder, &name, &std::fs::read_to_string(&path).unwrap());
        println!("{name}: {outcome:?}");
        assert!(matches!(outcome, Ok(Outcome::Rendered | Outcome::Refused)), "{outcome:?}");
    }
}
