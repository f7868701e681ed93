//! Everything that paths are traced through, committed and immutable.

use glam::{DVec3, Vec3};

use crate::camera::{Camera, Filter};
use crate::interaction::{Geometry, SurfaceInteraction};
use crate::light::Lights;
use crate::material::{Materials, Shading, Surface};
use crate::math::Rgb;
use crate::scene::description::Integrator;
use crate::texture::{TexturePoint, Textures};

/// A compiled scene. Nothing in it can change or fail any more.
pub struct World {
    /// Where the world's coordinates begin, in those of the scene's files: what is written into images is theirs.
    pub origin: DVec3,
    /// Film points to rays.
    pub camera: Camera,
    /// Sample offsets within a pixel.
    pub filter: Filter,
    /// Size of the frame and of the part to render, and how the sensor responds.
    pub sensor: Sensor,
    /// Committed geometry and its surfaces.
    pub geometry: Geometry,
    /// Textures.
    pub textures: Textures,
    /// Materials.
    pub materials: Materials,
    /// Lights.
    pub lights: Lights,
    /// Limits of transport.
    pub integrator: Integrator,
    /// How lights are found.
    pub techniques: Techniques,
}

/// Which techniques find the lights. Each is unbiased where no emitting surfaces share a place; that they agree is a test of
/// all three.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Techniques {
    /// Light samples and BSDF samples, weighted against each other.
    #[default]
    Both,
    /// Light samples alone, but for what only a delta lobe finds.
    Lights,
    /// BSDF samples alone, but for delta lights.
    Bsdfs,
}

/// A rectangle of pixels, upper ends exclusive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Bounds {
    /// First column and row.
    pub min: [u32; 2],
    /// One past the last column and row.
    pub max: [u32; 2],
}

impl Bounds {
    /// The whole of a resolution.
    pub fn full(resolution: [u32; 2]) -> Self {
        Self { min: [0, 0], max: resolution }
    }

    /// Columns.
    pub fn width(&self) -> u32 {
        self.max[0] - self.min[0]
    }

    /// Rows.
    pub fn height(&self) -> u32 {
        self.max[1] - self.min[1]
    }

    /// All pixels, row by row.
    pub fn pixels(&self) -> impl Iterator<Item = [u32; 2]> + use<> {
        let Self { min, max } = *self;
        (min[1]..max[1]).flat_map(move |y| (min[0]..max[0]).map(move |x| [x, y]))
    }

    /// Number of pixels.
    pub fn area(&self) -> u64 {
        u64::from(self.width()) * u64::from(self.height())
    }
}

/// The film's frame and response.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sensor {
    /// Width and height of the frame in pixels.
    pub resolution: [u32; 2],
    /// Pixels around the frame that there is room for, on every side.
    pub overscan: u32,
    /// The pixels to render; column and row [`Self::overscan`] are the frame's first.
    pub bounds: Bounds,
    /// Film RGB from scene RGB.
    pub response: glam::Mat3,
    /// Largest component of a sample; infinite unless the scene asks for clamping.
    pub max_component: f32,
}

impl Sensor {
    /// Column and row in the frame of a pixel of the film, less than 0 around it.
    #[inline]
    pub fn in_frame(&self, pixel: [u32; 2]) -> [i32; 2] {
        pixel.map(|at| at.wrapping_sub(self.overscan) as i32)
    }

    /// Film RGB of a sample's radiance, and the share of it that the sensor takes: less than 1 only if it clamps.
    pub fn expose(&self, radiance: Rgb) -> (Rgb, f32) {
        let exposed = self.response * radiance;
        let largest = exposed.max_element();
        let share = if largest > self.max_component { self.max_component / largest } else { 1.0 };
        (exposed * share, share)
    }
}

impl World {
    /// The material at a hit, ready to scatter; `None` at an interface that is no surface.
    ///
    /// `cone_radius`: of the path's cone at the hit, world units.
    #[inline(always)]
    pub fn shade(&self, vertex: &SurfaceInteraction<'_>, cone_radius: f32) -> Option<Shading<'_>> {
        let id = self.geometry.material(vertex);
        // What a material does not look at is not computed: most are one constant and need neither.
        let needs = self.materials.needs(id);
        let (dpdu, dpdv) = if needs.tangents { vertex.tangents() } else { (Vec3::ZERO, Vec3::ZERO) };
        let surface = Surface {
            texture_point: if needs.texture_point {
                vertex.texture_point(cone_radius)
            } else {
                TexturePoint::default()
            },
            p: vertex.point.p,
            ng: vertex.ng,
            ns: vertex.ns,
            dpdu,
            dpdv,
            wo: vertex.wo,
        };
        self.materials.shade(id, &surface, &self.textures)
    }
}
