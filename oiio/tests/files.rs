//! Images written and read back.

use std::path::Path;

use oiio::{Attribute, Channel, Compression, Error, FileFormat, Format, Output, Window};

fn channels(list: &[(&str, Format)]) -> Vec<Channel> {
    list.iter().map(|&(name, format)| Channel { name: name.to_owned(), format }).collect()
}

fn exr<'a>(path: &'a Path, window: Window, list: &[(&str, Format)], pixels: &'a [f32]) -> Output<'a> {
    Output {
        path,
        file_format: FileFormat::Exr,
        data_window: window,
        display_window: window,
        channels: channels(list),
        pixels,
        attributes: vec![],
        compression: Compression::default(),
    }
}

#[test]
fn half_and_float_channels_keep_what_their_formats_can_hold() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mixed.exr.part-1");
    // 1/3 is exact in neither; 2049 is exact in float and 2048 in half.
    let pixels = [1.0 / 3.0, 1.0 / 3.0, 2049.0, 2049.0, -0.5, 1.0e-6, 0.0, 16_777_215.0];
    let list = [("R", Format::Half), ("depth.Z", Format::Float)];
    let mut output = exr(&path, Window::at_origin(2, 2), &list, &pixels);
    output.compression = Compression::Piz;
    assert_eq!(oiio::write(&output).unwrap().clamped, 0);

    let image = oiio::read(&path).unwrap();
    let column = |name: &str| {
        let channel = image.channel(name).unwrap();
        image.pixels.chunks(2).map(|pixel| pixel[channel]).collect::<Vec<_>>()
    };
    assert_eq!(column("depth.Z"), [1.0 / 3.0, 2049.0, 1.0e-6, 16_777_215.0]);
    assert_eq!(column("R"), [0.333_251_95, 2048.0, -0.5, 0.0]);
    assert_eq!((image.format, image.eight_bit()), (Format::Float, false));
}

#[test]
fn values_beyond_half_are_clamped_and_counted_and_infinities_stay() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("big.exr");
    let pixels = [70_000.0, 1.0e9, -1.0e9, 1.0e9, f32::INFINITY, 65_504.0];
    let list = [("R", Format::Half), ("Z", Format::Float)];
    assert_eq!(oiio::write(&exr(&path, Window::at_origin(3, 1), &list, &pixels)).unwrap().clamped, 2);
    assert_eq!(oiio::read(&path).unwrap().pixels, [65_504.0, 1.0e9, -65_504.0, 1.0e9, f32::INFINITY, 65_504.0]);
}

#[test]
fn the_data_window_may_lie_anywhere_in_the_display_window() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("crop.exr");
    let pixels: Vec<f32> = (0..12).map(|i| i as f32).collect();
    let data = Window { x: 7, y: -3, width: 4, height: 3 };
    let mut output = exr(&path, data, &[("Y", Format::Float)], &pixels);
    output.display_window = Window::at_origin(640, 360);
    oiio::write(&output).unwrap();

    let image = oiio::read(&path).unwrap();
    assert_eq!((image.data_window, image.display_window), (data, Window::at_origin(640, 360)));
    assert_eq!((image.width, image.height), (4, 3));
    assert_eq!(image.pixels, pixels);
}

#[test]
fn attributes_of_every_kind_come_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("attributes.exr");
    let matrix = std::array::from_fn(|i| i as f32 * 0.5);
    let given = vec![
        ("Software".to_owned(), Attribute::Text("tessera \u{e9}".to_owned())),
        ("samplesPerPixel".to_owned(), Attribute::Int(-7)),
        ("renderTimeSeconds".to_owned(), Attribute::Float(1.25)),
        ("chromaticities".to_owned(), Attribute::Floats(vec![0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329])),
        ("worldtocamera".to_owned(), Attribute::Matrix(matrix)),
        ("framesPerSecond".to_owned(), Attribute::Rational(24000, 1001)),
        ("tessera/seed".to_owned(), Attribute::Text("18446744073709551615".to_owned())),
        ("DateTime".to_owned(), Attribute::Text("2026:01:02 03:04:05".to_owned())),
    ];
    let mut output = exr(&path, Window::at_origin(1, 1), &[("Y", Format::Half)], &[1.0]);
    output.attributes = given.clone();
    oiio::write(&output).unwrap();

    let image = oiio::read(&path).unwrap();
    for (name, value) in &given {
        assert_eq!(image.attribute(name), Some(value), "{name}");
    }
}

#[test]
fn the_same_picture_is_the_same_file_for_any_number_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    let pixels: Vec<f32> = (0..200 * 150 * 4).map(|i: u32| (i.wrapping_mul(2_654_435_761) >> 9) as f32).collect();
    let list = [("R", Format::Half), ("G", Format::Half), ("B", Format::Half), ("A", Format::Float)];
    let mut files = vec![];
    for (index, compression) in
        [Compression::None, Compression::Rle, Compression::Zips, Compression::Zip, Compression::Piz]
            .into_iter()
            .enumerate()
    {
        let of_threads = [1, 3].map(|threads| {
            oiio::set_threads(threads).unwrap();
            let path = folder.path().join(format!("{index}-{threads}.exr"));
            let mut output = exr(&path, Window::at_origin(200, 150), &list, &pixels);
            output.compression = compression;
            oiio::write(&output).unwrap();
            std::fs::read(&path).unwrap()
        });
        assert!(of_threads[0] == of_threads[1], "{compression:?}");
        files.push(of_threads[0].clone());
    }
    oiio::set_threads(1).unwrap();
    assert!(files[3].len() < files[0].len(), "zip compresses");
}

#[test]
fn png_keeps_eight_bits_and_does_not_multiply_by_alpha() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("p");
    let pixels = [0.0, 128.0 / 255.0, 1.0, 0.2, 1.5, -1.0];
    let list = [("R", Format::U8), ("G", Format::U8), ("B", Format::U8)];
    let mut output = exr(&path, Window::at_origin(2, 1), &list, &pixels);
    output.file_format = FileFormat::Png;
    oiio::write(&output).unwrap();
    let mut reader = oiio::Reader::open(&path).unwrap();
    assert_eq!(reader.format(), Format::U8);
    assert_eq!(reader.read_u8().unwrap(), [0, 128, 255, 51, 255, 0]);
    assert!(oiio::read(&path).unwrap().eight_bit());

    // Written premultiplied: stored as value / alpha, which is what a texture must see.
    let rgba = [0.25, 0.5, 0.0, 0.5];
    let list = [("R", Format::U8), ("G", Format::U8), ("B", Format::U8), ("A", Format::U8)];
    let mut output = exr(&path, Window::at_origin(1, 1), &list, &rgba);
    output.file_format = FileFormat::Png;
    oiio::write(&output).unwrap();
    let stored = oiio::Reader::open(&path).unwrap().read_u8().unwrap();
    assert_eq!(stored, [128, 255, 0, 128]);
}

#[test]
fn half_bits_are_those_of_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("half.exr");
    oiio::write(&exr(&path, Window::at_origin(3, 1), &[("Y", Format::Half)], &[1.0, -2.0, 0.0])).unwrap();
    let mut reader = oiio::Reader::open(&path).unwrap();
    assert_eq!(reader.format(), Format::Half);
    assert_eq!(reader.read_half_bits().unwrap(), [0x3c00, 0xc000, 0]);
}

#[test]
fn a_missing_file_is_named() {
    let error = oiio::read("no/such/picture.exr").unwrap_err();
    assert!(matches!(error, Error::Open { .. }), "{error:?}");
    assert!(error.to_string().contains("no/such/picture.exr"), "{error}");
}

#[test]
fn truncated_and_foreign_files_are_errors() {
    let folder = tempfile::tempdir().unwrap();
    let whole = folder.path().join("whole.exr");
    let pixels: Vec<f32> = (0..64 * 64).map(|i| (i as f32).sin()).collect();
    oiio::write(&exr(&whole, Window::at_origin(64, 64), &[("Y", Format::Float)], &pixels)).unwrap();
    let bytes = std::fs::read(&whole).unwrap();
    let path = folder.path().join("part.exr");
    for length in [0, 3, 40, 200, bytes.len() / 2, bytes.len() - 100] {
        std::fs::write(&path, &bytes[..length]).unwrap();
        let error = oiio::read(&path).expect_err(&format!("{length} of {} bytes", bytes.len()));
        assert!(error.to_string().contains("part.exr"), "{error}");
    }
    std::fs::write(&path, "not an image, whatever its name says").unwrap();
    assert!(matches!(oiio::read(&path), Err(Error::Open { .. })));
}

#[test]
fn writing_reports_wrong_shapes_bad_folders_and_bad_names() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.exr");
    let list = [("R", Format::Half)];
    assert!(matches!(oiio::write(&exr(&path, Window::at_origin(2, 2), &list, &[0.0; 3])), Err(Error::Write { .. })));
    assert!(matches!(oiio::write(&exr(&path, Window::at_origin(0, 2), &list, &[])), Err(Error::Write { .. })));
    let nowhere = folder.path().join("no-such-folder/x.exr");
    let error = oiio::write(&exr(&nowhere, Window::at_origin(1, 1), &list, &[0.0])).unwrap_err();
    assert!(error.to_string().contains("no-such-folder"), "{error}");
    let mut output = exr(&path, Window::at_origin(1, 1), &list, &[0.0]);
    output.attributes = vec![("a\0b".to_owned(), Attribute::Int(1))];
    assert!(matches!(oiio::write(&output), Err(Error::Write { .. })));
}
