//! Three channels of an image file, as `compare` and `preview` need them.

use std::path::Path;

use renderer::scene::pbrt::did_you_mean;

use crate::exit::Failure;
use crate::tone;

/// Linear values of three channels.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Row by row from the top.
    pub pixels: Vec<[f32; 3]>,
    /// Where the pixels lie in the frame.
    pub data_window: oiio::Window,
    /// The frame.
    pub display_window: oiio::Window,
    /// Whether it was made for displays: 8 bits a value.
    pub eight_bit: bool,
    /// The filter that made it, if the file says that there was one.
    pub filter: Option<String>,
}

impl Picture {
    /// Reads R G B of a file, or the channels of `layer`. One channel is shown as grey, two without a third. Values of
    /// an 8-bit file are taken to be sRGB-encoded.
    ///
    /// # Errors
    /// The file cannot be read, or has no such channels; the message names those that it has.
    pub fn read(path: &Path, layer: Option<&str>) -> Result<Self, Failure> {
        let image = oiio::read(path).map_err(|error| Failure::Input(error.to_string()))?;
        let Some(channels) = channels(&image.channels, layer) else {
            let wanted = layer.map_or_else(|| "channels R G B or Y".to_owned(), |layer| format!("layer {layer}"));
            let layers = layers(&image.channels);
            let meant = layer.map_or_else(String::new, |layer| did_you_mean(layer, layers.iter().copied()));
            let has = layers.join(" ");
            return Err(Failure::Input(format!("\"{}\" has no {wanted}; it has {has}{meant}", path.display())));
        };
        let linear = |value: f32| if image.eight_bit() { tone::linear_from_srgb(value) } else { value };
        let filter = match image.attribute("tessera/filter") {
            Some(oiio::Attribute::Text(filter)) if filter != "none" => filter.split(' ').next().map(str::to_owned),
            _ => None,
        };
        let pixel = |values: &[f32]| channels.map(|channel| channel.map_or(0.0, |channel| linear(values[channel])));
        Ok(Self {
            width: image.width,
            height: image.height,
            pixels: image.pixels.chunks_exact(image.channels.len()).map(pixel).collect(),
            data_window: image.data_window,
            display_window: image.display_window,
            eight_bit: image.eight_bit(),
            filter,
        })
    }
}

/// The same of a layer that the file need not have.
///
/// # Errors
/// The file cannot be read.
pub fn layer(path: &Path, layer: &str) -> Result<Option<Picture>, Failure> {
    let image = oiio::read(path).map_err(|error| Failure::Input(error.to_string()))?;
    channels(&image.channels, Some(layer)).map(|_| Picture::read(path, Some(layer))).transpose()
}

/// The layers that channels are of, and those that are of none, each once.
fn layers(channels: &[String]) -> Vec<&str> {
    let mut layers: Vec<&str> = Vec::new();
    for channel in channels {
        let layer = channel.rsplit_once('.').map_or(channel.as_str(), |(layer, _)| layer);
        if !layers.contains(&layer) {
            layers.push(layer);
        }
    }
    layers
}

/// Where the channels of a layer are.
fn channels(names: &[String], layer: Option<&str>) -> Option<[Option<usize>; 3]> {
    let find = |suffix: &str| match layer {
        None => names.iter().position(|name| name == suffix),
        Some(layer) => {
            names.iter().position(|name| name.strip_prefix(layer).and_then(|n| n.strip_prefix('.')) == Some(suffix))
        }
    };
    for set in [["R", "G", "B"], ["r", "g", "b"], ["X", "Y", "Z"]] {
        // The root layer's Y is a luminance.
        let found = set.map(find);
        if found[0].is_some() && found[1].is_some() {
            return Some(found);
        }
    }
    let whole = layer.and_then(|layer| names.iter().position(|name| name == layer));
    let single = find("Y").or_else(|| find("Z")).or(whole);
    single.map(|channel| [Some(channel); 3])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn find(names: &[&str], layer: Option<&str>) -> Option<[Option<usize>; 3]> {
        channels(&names.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>(), layer)
    }

    #[test]
    fn layers_are_found_by_their_channels() {
        let names =
            ["A", "B", "G", "N.X", "N.Y", "N.Z", "R", "albedo.R", "albedo.G", "albedo.B", "depth.Z", "sampleCount"];
        assert_eq!(find(&names, None), Some([Some(6), Some(2), Some(1)]));
        assert_eq!(find(&names, Some("albedo")), Some([Some(7), Some(8), Some(9)]));
        assert_eq!(find(&names, Some("N")), Some([Some(3), Some(4), Some(5)]));
        assert_eq!(find(&names, Some("depth")), Some([Some(10); 3]));
        assert_eq!(find(&names, Some("sampleCount")), Some([Some(11); 3]));
        assert_eq!(find(&names, Some("alb")), None);
        assert_eq!(find(&["Y"], None), Some([Some(0); 3]));
        assert_eq!(find(&["U", "V"], None), None);
    }
}
