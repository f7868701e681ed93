//! Every kind of texture, from its description to values that are known.

use std::path::{Path, PathBuf};

use glam::{Vec2, Vec3};
use oiio::Format;

use super::image::tests::{RGB8, write};
use super::*;
use crate::math::Transform;
use crate::scene::Span;
use crate::scene::description::{Encoding, ImageTexture, Mapping, Mapping2D, Texture, TextureKind};

const UV: Mapping2D = Mapping2D::Uv { scale: Vec2::ONE, delta: Vec2::ZERO };
const RED: Rgb = Rgb::new(1.0, 0.0, 0.0);
const BLUE: Rgb = Rgb::new(0.0, 0.0, 2.0);

fn describe(kinds: Vec<TextureKind>) -> Vec<Texture> {
    let span = |i| Span { file: 0, start: i, end: i + 1 };
    kinds.into_iter().zip(0..).map(|(kind, i)| Texture { name: format!("t{i}"), kind, span: span(i) }).collect()
}

/// The last of the textures, and the constant it folded to.
fn build(kinds: Vec<TextureKind>) -> (Textures, Value<Rgb>) {
    let last = Value::Texture(TextureId(kinds.len() as u32 - 1));
    let (textures, warnings) = Textures::build(&describe(kinds)).unwrap();
    assert_eq!(warnings, []);
    let folded = textures.folded_rgb(&last);
    (textures, folded)
}

fn errors(kinds: Vec<TextureKind>) -> Vec<TextureError> {
    Textures::build(&describe(kinds)).unwrap_err()
}

fn at_uv(u: f32, v: f32) -> TexturePoint {
    TexturePoint { uv: Vec2::new(u, v), ..TexturePoint::default() }
}

fn constant<T>(value: T) -> Value<T> {
    Value::Constant(value)
}

fn texture<T>(id: u32) -> Value<T> {
    Value::Texture(TextureId(id))
}

/// Varies, so nothing made of it folds: red grows with u, green with v.
fn ramp() -> TextureKind {
    TextureKind::Bilerp { corners: [Rgb::ZERO, RED, Rgb::Y, Rgb::new(1.0, 1.0, 0.0)], mapping: UV }
}

fn image_texture(path: PathBuf) -> ImageTexture {
    ImageTexture {
        path,
        mapping: UV,
        wrap: Wrap::Repeat,
        filter: TextureFilter::Bilinear,
        encoding: None,
        scale: 1.0,
        invert: false,
        monochrome: false,
    }
}

/// A float image of one channel whose rows are given from the top.
fn grey(folder: &Path, name: &str, rows: &[&[f32]]) -> PathBuf {
    let path = folder.join(name);
    write(&path, [rows[0].len(), rows.len()], &[("Y", Format::Float)], &rows.concat());
    path
}

#[test]
fn constants_are_themselves_and_cost_nothing() {
    let (textures, value) = build(vec![TextureKind::Constant(BLUE)]);
    assert_eq!(value, constant(BLUE));
    assert_eq!(textures.rgb(&texture(0), &at_uv(0.0, 0.0)), BLUE);
    assert_eq!(textures.folded_float(&texture(0)), constant(0.0));
    assert_eq!(textures.float(&constant(3.0), &at_uv(0.0, 0.0)), 3.0);
}

#[test]
fn bilerp_meets_its_corners() {
    let (textures, value) = build(vec![ramp()]);
    for (u, v) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0), (0.25, 0.75)] {
        assert!((textures.rgb(&value, &at_uv(u, v)) - Rgb::new(u, v, 0.0)).length() < 1e-6);
    }
    assert_eq!(build(vec![TextureKind::Bilerp { corners: [RED; 4], mapping: UV }]).1, constant(RED));
}

#[test]
fn scale_multiplies_and_folds() {
    let half = |tex| TextureKind::Scale { tex, scale: constant(0.5) };
    assert_eq!(build(vec![half(constant(BLUE))]).1, constant(0.5 * BLUE));
    let (textures, value) = build(vec![ramp(), half(texture(0))]);
    assert!((textures.rgb(&value, &at_uv(0.5, 0.25)) - Rgb::new(0.25, 0.125, 0.0)).length() < 1e-6);
    let by_texture = TextureKind::Scale { tex: constant(BLUE), scale: texture(0) };
    let (textures, value) = build(vec![ramp(), by_texture]);
    assert!((textures.rgb(&value, &at_uv(0.5, 0.0)) - 0.5 * BLUE).length() < 1e-6);
    assert_eq!(textures.rgb(&value, &at_uv(0.0, 0.0)), Rgb::ZERO);
}

#[test]
fn mix_goes_from_the_first_to_the_second() {
    let mix = |amount| TextureKind::Mix { tex1: constant(RED), tex2: constant(BLUE), amount };
    assert_eq!(build(vec![mix(constant(0.25))]).1, constant(0.75 * RED + 0.25 * BLUE));
    assert_eq!(build(vec![mix(constant(0.0))]).1, constant(RED));
    let (textures, value) = build(vec![ramp(), mix(texture(0))]);
    for (u, expected) in [(0.0, RED), (1.0, BLUE), (0.5, 0.5 * (RED + BLUE))] {
        assert!((textures.rgb(&value, &at_uv(u, 0.3)) - expected).length() < 1e-6);
    }
    // An amount of 1 passes the second texture through.
    let through = TextureKind::Mix { tex1: constant(RED), tex2: texture(0), amount: constant(1.0) };
    let (textures, value) = build(vec![ramp(), through]);
    assert_eq!(textures.rgb(&value, &at_uv(1.0, 1.0)), Rgb::new(1.0, 1.0, 0.0));
}

#[test]
fn direction_mix_follows_the_normal() {
    let kind = TextureKind::DirectionMix { tex1: constant(RED), tex2: constant(BLUE), dir: Vec3::Y };
    let (textures, value) = build(vec![kind]);
    let facing = |n| textures.rgb(&value, &TexturePoint { n, ..TexturePoint::default() });
    assert_eq!((facing(Vec3::X), facing(Vec3::Y), facing(-Vec3::Y)), (RED, BLUE, BLUE));
    assert!((facing(Vec3::new(0.8, 0.6, 0.0)) - (0.4 * RED + 0.6 * BLUE)).length() < 1e-6);
}

#[test]
fn checkerboards_alternate_in_two_and_three_dimensions() {
    let board = |mapping| TextureKind::Checkerboard { mapping, tex: [constant(RED), constant(BLUE)] };
    let scaled = Mapping2D::Uv { scale: Vec2::splat(10.0), delta: Vec2::ZERO };
    let (textures, value) = build(vec![board(Mapping::Two(scaled))]);
    assert_eq!(textures.rgb(&value, &at_uv(0.05, 0.05)), RED);
    assert_eq!(textures.rgb(&value, &at_uv(0.15, 0.05)), BLUE);
    // The tent spans 3 pixels of 0.2 checks to each side of a border.
    let blurred = TexturePoint { duvdx: Vec2::X * 0.02, duvdy: Vec2::Y * 0.02, ..at_uv(0.1, 0.05) };
    assert!((textures.rgb(&value, &blurred) - 0.5 * (RED + BLUE)).length() < 1e-5);

    let (textures, value) = build(vec![board(Mapping::Three(Transform::default()))]);
    let inside = |p| textures.rgb(&value, &TexturePoint { p, ..TexturePoint::default() });
    assert_eq!((inside(Vec3::splat(0.5)), inside(Vec3::new(0.5, 0.5, -0.5))), (RED, BLUE));
}

#[test]
fn dots_show_one_of_two() {
    let kind = TextureKind::Dots { mapping: UV, inside: constant(RED), outside: constant(BLUE) };
    let (textures, value) = build(vec![kind]);
    let shown: Vec<Rgb> = (0..100).map(|i| textures.rgb(&value, &at_uv((i % 10) as f32, (i / 10) as f32))).collect();
    assert!(shown.contains(&RED) && shown.contains(&BLUE));
    assert_eq!(textures.rgb(&value, &at_uv(0.499, 0.499)), BLUE);
}

#[test]
fn noises_are_numbers_in_all_channels_placed_by_their_transform() {
    let shifted = Transform::new(glam::DMat4::from_translation(glam::DVec3::new(0.5, 0.0, 0.0)));
    let kinds = vec![
        TextureKind::Fbm { texture_from_world: shifted, octaves: 1, omega: 0.5 },
        TextureKind::Wrinkled { texture_from_world: shifted, octaves: 1, omega: 0.5 },
        TextureKind::Windy { texture_from_world: shifted },
    ];
    let (textures, _) = build(kinds);
    let p = Vec3::new(0.1, 0.3, 0.7);
    let at = TexturePoint { p, ..TexturePoint::default() };
    let expected = noise::noise(p + Vec3::X * 0.5);
    assert_eq!(textures.rgb(&texture(0), &at), Rgb::splat(expected));
    assert!((textures.float(&texture(1), &at) - (expected.abs() + 0.5 * 0.2)).abs() < 1e-6);
    assert!(textures.float(&texture(2), &at).is_finite());
}

#[test]
fn marble_is_grey_and_an_albedo() {
    let kind = TextureKind::Marble {
        texture_from_world: Transform::default(),
        octaves: 8,
        omega: 0.5,
        scale: 3.0,
        variation: 0.2,
    };
    let (textures, value) = build(vec![kind]);
    for i in 0..200 {
        let p = Vec3::new(0.37, 0.11, 0.73) * i as f32;
        let albedo = textures.rgb(&value, &TexturePoint { p, ..TexturePoint::default() });
        assert!(albedo.min_element() >= 0.29 && albedo.max_element() <= 0.91, "{albedo}");
    }
}

#[test]
fn images_have_v_upwards_and_decode_before_filtering() {
    let folder = tempfile::tempdir().unwrap();
    // Top row black and white, bottom row red and blue.
    let path = folder.path().join("four.png");
    write(&path, [2, 2], &RGB8, &[0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
    let (textures, value) = build(vec![TextureKind::Image(image_texture(path.clone()))]);
    assert_eq!(textures.rgb(&value, &at_uv(0.25, 0.25)), RED);
    assert_eq!(textures.rgb(&value, &at_uv(0.75, 0.75)), Rgb::ONE);
    // Between black and white lies half the light, not half the code.
    assert!((textures.rgb(&value, &at_uv(0.5, 0.75)) - Rgb::splat(0.5)).length() < 1e-6);
    // A footprint as wide as the image sees its mean: (red + blue + white) / 4, to a code of the last level.
    let wide = TexturePoint { duvdx: Vec2::X, duvdy: Vec2::Y, ..at_uv(0.1, 0.2) };
    assert!((textures.rgb(&value, &wide) - Rgb::new(0.5, 0.25, 0.5)).abs().max_element() < 0.005);
    assert_eq!(textures.bytes(), (4 + 1) * 3);

    let linear = ImageTexture { encoding: Some(Encoding::Gamma(1.0)), scale: 0.5, ..image_texture(path.clone()) };
    let inverted = ImageTexture { invert: true, ..linear.clone() };
    let mean = ImageTexture { monochrome: true, ..image_texture(path) };
    let (textures, _) = build([linear, inverted, mean].map(TextureKind::Image).to_vec());
    let corner = at_uv(0.25, 0.25);
    assert_eq!(textures.rgb(&texture(0), &corner), 0.5 * RED);
    assert_eq!(textures.rgb(&texture(1), &corner), Rgb::new(0.5, 1.0, 1.0));
    assert!((textures.float(&texture(2), &corner) - 1.0 / 3.0).abs() < 1e-6);
}

#[test]
fn wraps_differ_beyond_the_edges() {
    let folder = tempfile::tempdir().unwrap();
    let path = grey(folder.path(), "edge.exr", &[&[1.0, 2.0], &[3.0, 4.0]]);
    let shown = |wrap, u: f32, v: f32| {
        let filter = TextureFilter::Point;
        let (textures, value) =
            build(vec![TextureKind::Image(ImageTexture { wrap, filter, ..image_texture(path.clone()) })]);
        textures.rgb(&value, &at_uv(u, v)).x
    };
    // v upwards: 3 is at the lower left.
    for (wrap, left, right, above, far) in [
        (Wrap::Repeat, 4.0, 3.0, 3.0, 3.0),
        (Wrap::Black, 0.0, 0.0, 0.0, 0.0),
        (Wrap::Clamp, 3.0, 4.0, 1.0, 2.0),
        // On its right edge the square meets the other half of that edge.
        (Wrap::OctahedralSphere, 3.0, 2.0, 1.0, 4.0),
    ] {
        assert_eq!(shown(wrap, 0.25, 0.25), 3.0);
        let beyond = [(-0.25, 0.25), (1.25, 0.25), (0.25, 1.25), (1000.25, 77.25)];
        assert_eq!(beyond.map(|(u, v)| shown(wrap, u, v)), [left, right, above, far], "{wrap:?}");
    }
}

#[test]
fn images_that_are_one_value_fold_into_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = grey(folder.path(), "flat.exr", &[&[0.25, 0.25, 0.25], &[0.25, 0.25, 0.25]]);
    let flat = ImageTexture { scale: 2.0, ..image_texture(path) };
    assert_eq!(build(vec![TextureKind::Image(flat.clone())]).1, constant(Rgb::splat(0.5)));
    // Beyond its edges a black-wrapped image is not flat.
    let (textures, value) = build(vec![TextureKind::Image(ImageTexture { wrap: Wrap::Black, ..flat })]);
    assert_eq!(textures.rgb(&value, &at_uv(0.5, 0.5)), Rgb::splat(0.5));
    assert_eq!(textures.rgb(&value, &at_uv(1.5, 0.5)), Rgb::ZERO);
}

#[test]
fn one_file_is_kept_once_and_alpha_apart() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("leaf.exr");
    let rgba = [("R", Format::Half), ("G", Format::Half), ("B", Format::Half), ("A", Format::Half)];
    write(&path, [2, 1], &rgba, &[1.0, 0.5, 0.25, 1.0, 0.0, 0.0, 0.5, 0.0]);
    let rgb = image_texture(path);
    let mask = ImageTexture { monochrome: true, ..rgb.clone() };
    let (textures, _) = build([rgb.clone(), mask, rgb].map(TextureKind::Image).to_vec());
    assert_eq!(textures.rgb(&texture(0), &at_uv(0.25, 0.5)), Rgb::new(1.0, 0.5, 0.25));
    assert_eq!(textures.float(&texture(1), &at_uv(0.75, 0.5)), 0.0);
    assert_eq!(textures.float(&texture(1), &at_uv(0.5, 0.5)), 0.5);
    assert_eq!(textures.bytes(), 2 * 3 * (2 + 1) + 2 * (2 + 1));
}

#[test]
fn all_errors_are_reported_with_their_places() {
    let folder = tempfile::tempdir().unwrap();
    let missing = TextureKind::Image(image_texture(folder.path().join("missing.png")));
    let forward = TextureKind::Scale { tex: texture(5), scale: constant(1.0) };
    let found = errors(vec![missing, TextureKind::Constant(RED), forward]);
    assert_eq!(found.iter().map(|e| e.span.start).collect::<Vec<_>>(), [0, 2]);
    assert!(found[0].message.contains("\"t0\"") && found[0].message.contains("missing.png"), "{}", found[0]);
    assert!(found[1].message.contains("\"t2\""), "{}", found[1]);
}

#[test]
fn textures_of_textures_end() {
    let double = |id| TextureKind::Mix { tex1: texture(id), tex2: texture(id), amount: texture(id) };
    let mut kinds = vec![ramp()];
    kinds.extend((0..40).map(double));
    assert!(errors(kinds)[0].message.contains("too many"));
    let mut kinds = vec![ramp()];
    kinds.extend((0..1000).map(|id| TextureKind::Scale { tex: texture(id), scale: constant(0.5) }));
    assert!(errors(kinds)[0].message.contains("too many"));
}

#[test]
fn values_that_are_no_numbers_are_replaced_with_a_warning() {
    let folder = tempfile::tempdir().unwrap();
    let path = grey(folder.path(), "broken.exr", &[&[1.0, f32::NAN], &[f32::INFINITY, 4.0]]);
    let kinds = vec![TextureKind::Image(image_texture(path))];
    let (textures, warnings) = Textures::build(&describe(kinds)).unwrap();
    assert!(warnings[0].message.contains("broken.exr") && warnings[0].message.contains("2 values"), "{}", warnings[0]);
    assert_eq!(textures.rgb(&texture(0), &at_uv(0.75, 0.75)), Rgb::ZERO);
}
