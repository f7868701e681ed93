//! RGB spaces of scene files and films, and white balance.

use glam::{DMat3, DVec2, DVec3, Mat3};

use super::illuminant::{self, D60};
use super::observer;

/// Chromaticities (x, y) of the red, green and blue primaries.
pub(super) type Primaries = [[f64; 2]; 3];

/// ITU-R BT.709.
pub(super) const REC709: Primaries = [[0.64, 0.33], [0.30, 0.60], [0.15, 0.06]];
/// P3 with the white of D65, as displays use it.
const P3: Primaries = [[0.68, 0.32], [0.265, 0.690], [0.15, 0.06]];
/// ITU-R BT.2020.
const REC2020: Primaries = [[0.708, 0.292], [0.170, 0.797], [0.131, 0.046]];
/// SMPTE ST 2065-1.
const ACES: Primaries = [[0.7347, 0.2653], [0.0, 1.0], [0.0001, -0.077]];

/// A linear RGB space, by its primaries and white.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RgbSpace {
    /// Rec.709 primaries, D65: the renderer's own.
    #[default]
    Srgb,
    /// P3 primaries, D65.
    DciP3,
    /// Rec.2020 primaries, D65.
    Rec2020,
    /// ACES primaries, D60.
    Aces2065,
}

impl RgbSpace {
    const ALL: [Self; 4] = [Self::Srgb, Self::DciP3, Self::Rec2020, Self::Aces2065];

    /// The space with these [`Self::chromaticities`], of red, green, blue and white in turn, to three decimals: files state
    /// them with four.
    pub fn with_chromaticities(xy: &[f32]) -> Option<Self> {
        let alike = |space: &Self| {
            let own = space.chromaticities();
            xy.len() == 8 && own.as_flattened().iter().zip(xy).all(|(a, b)| (a - b).abs() < 1e-3)
        };
        Self::ALL.into_iter().find(alike)
    }

    /// The space of this name in pbrt-v4, in any case: `srgb`, `dci-p3`, `rec2020`, `aces2065-1`.
    pub fn named(name: &str) -> Option<Self> {
        match name.to_ascii_lowercase().as_str() {
            "srgb" => Some(Self::Srgb),
            "dci-p3" => Some(Self::DciP3),
            "rec2020" => Some(Self::Rec2020),
            "aces2065-1" => Some(Self::Aces2065),
            _ => None,
        }
    }

    /// Linear Rec.709 from this space, for light: the same XYZ. White stays this space's white, so ACES' is warmer than
    /// (1, 1, 1).
    pub fn rec709_from_light(self) -> Mat3 {
        self.to_mat3(observer::rec709_from_xyz() * self.xyz_from_rgb())
    }

    /// Linear Rec.709 from this space, for reflectances and other ratios, which have no white of their own: (1, 1, 1) stays
    /// (1, 1, 1), by Bradford's adaptation.
    pub fn rec709_from_reflectance(self) -> Mat3 {
        let adapted = adaptation(self.white(), observer::d65_white()) * self.xyz_from_rgb();
        self.to_mat3(observer::rec709_from_xyz() * adapted)
    }

    /// This space, as that of a film, from linear Rec.709 radiance.
    ///
    /// `white_balance` is the nominal temperature (K) of the daylight that the sensor shows as this space's white; `None`:
    /// the film shows the XYZ that are there.
    ///
    /// **Source**: pbrt-v4's sensor "cie1931" (\[Pharr23\] section 5.4.2).
    pub fn film_from_rec709(self, white_balance: Option<f32>) -> Mat3 {
        let balance = match white_balance {
            Some(kelvin) => {
                let daylight = illuminant::daylight(kelvin);
                let source = observer::xyz(|lambda| daylight.value(lambda));
                if source.y > 0.0 { adaptation(source / source.y, self.white()) } else { DMat3::IDENTITY }
            }
            None if self == Self::Srgb => return Mat3::IDENTITY,
            None => DMat3::IDENTITY,
        };
        (self.xyz_from_rgb().inverse() * balance * observer::rec709_from_xyz().inverse()).as_mat3()
    }

    /// CIE chromaticities of red, green, blue and white, as the EXR attribute `chromaticities` wants them.
    pub fn chromaticities(self) -> [[f32; 2]; 4] {
        let white = self.white() / self.white().element_sum();
        let [r, g, b] = self.primaries();
        [r, g, b, [white.x, white.y]].map(|xy| xy.map(|value| value as f32))
    }

    fn primaries(self) -> Primaries {
        match self {
            Self::Srgb => REC709,
            Self::DciP3 => P3,
            Self::Rec2020 => REC2020,
            Self::Aces2065 => ACES,
        }
    }

    /// XYZ of the white at Y = 1.
    fn white(self) -> DVec3 {
        match self {
            Self::Aces2065 => {
                let white = observer::xyz(|lambda| illuminant::daylight_value(D60, lambda));
                white / white.y
            }
            _ => observer::d65_white(),
        }
    }

    fn xyz_from_rgb(self) -> DMat3 {
        xyz_from_rgb(self.primaries(), self.white())
    }

    /// Exact for the renderer's own space, where the product of a matrix and its inverse is rounded.
    fn to_mat3(self, matrix: DMat3) -> Mat3 {
        if self == Self::Srgb { Mat3::IDENTITY } else { matrix.as_mat3() }
    }
}

/// XYZ from linear RGB: the primaries scaled so that their sum is `white`.
pub(super) fn xyz_from_rgb(primaries: Primaries, white: DVec3) -> DMat3 {
    let [r, g, b] = primaries.map(|xy| {
        let xy = DVec2::from(xy);
        DVec3::new(xy.x, xy.y, 1.0 - xy.x - xy.y)
    });
    let unscaled = DMat3::from_cols(r, g, b);
    unscaled * DMat3::from_diagonal(unscaled.inverse() * white)
}

/// Bradford's linear adaptation, a von Kries scaling of sharpened cone responses, taking one white (XYZ) to another.
///
/// **Source**: \[Lam85\], matrix as in ICC.1:2022 annex E.
fn adaptation(from: DVec3, to: DVec3) -> DMat3 {
    let cones = DMat3::from_cols(
        DVec3::new(0.8951, -0.7502, 0.0389),
        DVec3::new(0.2664, 1.7135, -0.0685),
        DVec3::new(-0.1614, 0.0367, 1.0296),
    );
    cones.inverse() * DMat3::from_diagonal((cones * to) / (cones * from)) * cones
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Rgb;

    #[test]
    fn names_are_those_of_scene_files() {
        for (name, space) in ["sRGB", "dci-p3", "REC2020", "aces2065-1"].into_iter().zip(RgbSpace::ALL) {
            assert_eq!(RgbSpace::named(name), Some(space));
        }
        assert_eq!(RgbSpace::named("adobe"), None);
    }

    #[test]
    fn matrices_match_published_ones() {
        // IEC 61966-2-1 prints four figures and rounds its white to (0.3127, 0.3290), 1.5e-4 from ours in XYZ.
        let expected = DMat3::from_cols(
            DVec3::new(3.2406, -0.9689, 0.0557),
            DVec3::new(-1.5372, 1.8758, -0.2040),
            DVec3::new(-0.4986, 0.0415, 1.0570),
        );
        let difference = observer::rec709_from_xyz() - expected;
        assert!(difference.to_cols_array().iter().all(|d| d.abs() < 1e-3), "{difference}");
        // ITU-R BT.2087-0: Rec.2020 to Rec.709 (of the inverse that it prints, to four figures).
        let rec2020 = RgbSpace::Rec2020.rec709_from_light();
        let expected = Mat3::from_cols(
            Rgb::new(1.6605, -0.1246, -0.0182),
            Rgb::new(-0.5876, 1.1329, -0.1006),
            Rgb::new(-0.0728, -0.0083, 1.1187),
        );
        assert!((rec2020 - expected).to_cols_array().iter().all(|d| d.abs() < 2e-4), "{rec2020}");
        // ACES to Rec.709 with Bradford's adaptation, as the ACES project publishes it.
        let aces = RgbSpace::Aces2065.rec709_from_reflectance();
        let expected = Mat3::from_cols(
            Rgb::new(2.5216, -0.2765, -0.0154),
            Rgb::new(-1.1341, 1.3727, -0.1530),
            Rgb::new(-0.3876, -0.0962, 1.1684),
        );
        assert!((aces - expected).to_cols_array().iter().all(|d| d.abs() < 1e-3), "{aces}");
    }

    #[test]
    fn white_stays_white_where_it_should() {
        for space in RgbSpace::ALL {
            assert!((space.rec709_from_reflectance() * Rgb::ONE - 1.0).abs().max_element() < 1e-6);
            let there_and_back = space.film_from_rec709(None) * space.rec709_from_light();
            assert!((there_and_back - Mat3::IDENTITY).to_cols_array().iter().all(|d| d.abs() < 1e-5));
        }
        assert_eq!(RgbSpace::Srgb.rec709_from_light(), Mat3::IDENTITY);
        assert_eq!(RgbSpace::Srgb.film_from_rec709(None), Mat3::IDENTITY);
        // The white of ACES is that of D60: more red, less blue than D65.
        let aces = RgbSpace::Aces2065.rec709_from_light() * Rgb::ONE;
        assert!(aces.x > 1.02 && aces.z < 0.93, "{aces}");
    }

    #[test]
    fn white_balance_makes_its_daylight_white() {
        for kelvin in [3200.0, 5000.0, 6500.0, 9000.0] {
            for space in RgbSpace::ALL {
                let light = illuminant::daylight(kelvin).illuminant_rgb();
                let film = space.film_from_rec709(Some(kelvin)) * light;
                assert!((film / film.y - 1.0).abs().max_element() < 1e-5, "{space:?} {kelvin} K: {film}");
            }
        }
        // D65's own daylight leaves sRGB as it is, up to the rounding of D65's weights.
        let difference = RgbSpace::Srgb.film_from_rec709(Some(6500.0)) - Mat3::IDENTITY;
        assert!(difference.to_cols_array().iter().all(|d| d.abs() < 1e-3), "{difference}");
        assert!(
            (RgbSpace::Srgb.film_from_rec709(Some(0.0)) - Mat3::IDENTITY)
                .to_cols_array()
                .iter()
                .all(|d| d.abs() < 1e-6)
        );
    }

    #[test]
    fn chromaticities_end_with_the_white() {
        let [r, _, _, white] = RgbSpace::Aces2065.chromaticities();
        assert_eq!(r, [0.7347, 0.2653]);
        assert!((white[0] - 0.32168).abs() < 5e-5 && (white[1] - 0.33767).abs() < 5e-5);
        for space in RgbSpace::ALL {
            assert_eq!(RgbSpace::with_chromaticities(space.chromaticities().as_flattened()), Some(space));
        }
        // P3 with the white of cinemas, and no chromaticities at all.
        assert_eq!(RgbSpace::with_chromaticities(&[0.68, 0.32, 0.265, 0.69, 0.15, 0.06, 0.314, 0.351]), None);
        assert_eq!(RgbSpace::with_chromaticities(&[]), None);
    }
}
