//! Every scene of others renders: no error, no sample rejected.
#![allow(clippy::print_stdout, reason = "tests print the figures that they judge")]

use tests::{render, shared};

#[test]
fn all_scenes_of_others_render_without_a_rejected_sample() {
    for name in shared::SCENES {
        let Some(scene) = shared::scene(name) else { return };
        let frame = render::quick(&scene, 4, Some([160, 120]));
        let mean = frame.film.mean();
        println!("{name:20} mean {mean:.4} {:?}", frame.statistics.counters);
        assert_eq!(frame.statistics.counters.rejected_samples, 0, "{name}: rejected samples");
        assert!(mean.min_element() > 0.0, "{name} is black");
    }
}
