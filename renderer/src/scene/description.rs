//! The description of a scene: what its files say, typed and checked, with every default filled in.
//!
//! Nothing here knows the syntax it was read from (that is [`super::pbrt`]'s) nor how it will be rendered (that is
//! [`crate::compile`]'s). Everything is in the units of the file; angles are in degrees where the field says so.
//! Radiances are already scaled so that a sensor of the default film (ISO 100, 1 s) sees them as they stand.

use std::path::PathBuf;
use std::sync::Arc;

use glam::{DVec3, Vec2, Vec3};

use super::{SourceMap, Span};
use crate::math::{Rgb, Transform};
use crate::spectrum::Spectrum;

/// A whole scene.
#[derive(Clone, Debug)]
pub struct Scene {
    /// The files it came from: [`Span`]s below point into them.
    pub sources: SourceMap,
    /// Where world space begins, in that of the files: at their own origin unless [`Scene::move_origin`] has moved it.
    pub origin: DVec3,
    /// The camera.
    pub camera: Camera,
    /// The film.
    pub film: Film,
    /// The pixel filter.
    pub filter: PixelFilter,
    /// Samples per pixel that the file asks for.
    pub spp: u64,
    /// Seed that the file asks for.
    pub seed: u64,
    /// How light is transported.
    pub integrator: Integrator,
    /// Textures. An entry refers only to entries before it.
    pub textures: Vec<Texture>,
    /// Materials. An entry refers only to entries before it. Entry 0 is what a shape without a material has.
    pub materials: Vec<Material>,
    /// Lights that are not shapes.
    pub lights: Vec<Light>,
    /// Emission of shapes.
    pub area_lights: Vec<AreaLight>,
    /// Participating media: understood, not yet rendered.
    pub media: Vec<Medium>,
    /// Shapes placed in the world.
    pub shapes: Vec<Shape>,
    /// Groups of shapes for instancing. Nested instances are flattened by the reader.
    pub objects: Vec<Object>,
    /// Placed copies of objects.
    pub instances: Vec<Instance>,
}

macro_rules! ids {
    ($($(#[$doc:meta])* $name:ident),* $(,)?) => {$(
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
        pub struct $name(pub u32);

        impl $name {
            /// As an index.
            pub fn index(self) -> usize {
                self.0 as usize
            }
        }
    )*};
}
ids! {
    /// Index into [`Scene::textures`].
    TextureId,
    /// Index into [`Scene::materials`].
    MaterialId,
    /// Index into [`Scene::area_lights`].
    AreaLightId,
    /// Index into [`Scene::objects`].
    ObjectId,
    /// Index into [`Scene::media`].
    MediumId,
}

/// Either one value everywhere, or a texture.
#[derive(Clone, Debug, PartialEq)]
pub enum Value<T> {
    /// The same everywhere.
    Constant(T),
    /// Looked up at the hit.
    Texture(TextureId),
}

/// Camera, film side up to the lens.
#[derive(Clone, Debug)]
pub struct Camera {
    /// Camera space: looks along +z, y up, x to the right (left-handed, as pbrt's).
    pub world_from_camera: Transform,
    /// Kind and its own parameters.
    pub kind: CameraKind,
    /// Radius of the lens, 0 for a pinhole.
    pub lens_radius: f32,
    /// Distance in focus.
    pub focal_distance: f32,
    /// Extent of the image on the screen plane, x0 x1 y0 y1; `None`: [-1, 1] along the shorter side, by aspect ratio.
    pub screen_window: Option<[f32; 4]>,
    /// Width over height of the frame; `None`: that of the resolution.
    pub frame_aspect_ratio: Option<f32>,
    /// Where the camera was described.
    pub span: Span,
}

/// How a film point becomes a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CameraKind {
    /// Full angle of view in degrees across the shorter side.
    Perspective {
        /// Degrees.
        fov: f32,
    },
    /// Parallel projection.
    Orthographic,
    /// All directions.
    Spherical {
        /// Equal-area instead of latitude-longitude.
        equal_area: bool,
    },
}

/// Film and sensor.
#[derive(Clone, Debug)]
pub struct Film {
    /// Width and height in pixels.
    pub resolution: [u32; 2],
    /// Pixels rendered around the image on every side.
    pub overscan: u32,
    /// Fraction of the image rendered, x0 x1 y0 y1 in [0, 1], y down.
    pub crop_window: Option<[f32; 4]>,
    /// Pixels rendered, x0 x1 y0 y1, upper ends exclusive. Wins over the crop window.
    pub pixel_bounds: Option<[i32; 4]>,
    /// The output that the file names.
    pub filename: Option<PathBuf>,
    /// Whether the auxiliary channels were asked for (`gbuffer`).
    pub gbuffer: bool,
    /// Linear map from scene-referred RGB to film RGB: exposure and white balance of the sensor.
    pub sensor: glam::Mat3,
    /// Samples are clamped to this maximum component; infinite: no clamping.
    pub max_component_value: f32,
    /// Where the film was described.
    pub span: Span,
}

/// Reconstruction filter of pixels. Radii in pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PixelFilter {
    /// Half width and half height of the support.
    pub radius: Vec2,
    /// Shape.
    pub kind: PixelFilterKind,
}

/// Shape of the pixel filter, by pbrt's parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PixelFilterKind {
    /// Constant.
    Box,
    /// Tent.
    Triangle,
    /// Gaussian less its value at the radius.
    Gaussian {
        /// Standard deviation, pixels.
        sigma: f32,
    },
    /// Mitchell–Netravali.
    Mitchell {
        /// B.
        b: f32,
        /// C.
        c: f32,
    },
    /// Lanczos-windowed sinc.
    LanczosSinc {
        /// Cycles before the window ends.
        tau: f32,
    },
}

/// Limits of light transport.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Integrator {
    /// Largest number of scattering events of a path; 0 shows emitters only.
    pub max_depth: u32,
    /// Roughen near-specular surfaces after the first non-specular bounce.
    pub regularize: bool,
}

/// One texture. Float textures yield their value in all three channels.
#[derive(Clone, Debug)]
pub struct Texture {
    /// Its name in the file, for messages.
    pub name: String,
    /// What it computes.
    pub kind: TextureKind,
    /// Where it was described.
    pub span: Span,
}

/// What a texture computes.
#[derive(Clone, Debug)]
pub enum TextureKind {
    /// One value.
    Constant(Rgb),
    /// Product.
    Scale {
        /// What is scaled.
        tex: Value<Rgb>,
        /// By what (a float texture).
        scale: Value<f32>,
    },
    /// tex1 (1 − amount) + tex2 amount.
    Mix {
        /// At amount 0.
        tex1: Value<Rgb>,
        /// At amount 1.
        tex2: Value<Rgb>,
        /// Weight (a float texture).
        amount: Value<f32>,
    },
    /// As `Mix` with amount = |n · dir|.
    DirectionMix {
        /// Where the normal is orthogonal to `dir`.
        tex1: Value<Rgb>,
        /// Where the normal is along `dir`.
        tex2: Value<Rgb>,
        /// Unit, world space.
        dir: Vec3,
    },
    /// Bilinear interpolation over (u, v) of four corners 00 01 10 11, index = vu: the second is that of u = 1, v = 0.
    Bilerp {
        /// Corner values.
        corners: [Rgb; 4],
        /// uv of the surface.
        mapping: Mapping2D,
    },
    /// An image file.
    Image(ImageTexture),
    /// Checks in 2D or 3D.
    Checkerboard {
        /// 2D or 3D domain.
        mapping: Mapping,
        /// The two values.
        tex: [Value<Rgb>; 2],
    },
    /// Polka dots.
    Dots {
        /// Domain.
        mapping: Mapping2D,
        /// In a dot.
        inside: Value<Rgb>,
        /// Between dots.
        outside: Value<Rgb>,
    },
    /// Fractional Brownian motion.
    Fbm {
        /// Texture space from world.
        texture_from_world: Transform,
        /// Octaves.
        octaves: u32,
        /// Ratio of successive amplitudes.
        omega: f32,
    },
    /// Turbulence.
    Wrinkled {
        /// Texture space from world.
        texture_from_world: Transform,
        /// Octaves.
        octaves: u32,
        /// Ratio of successive amplitudes.
        omega: f32,
    },
    /// Waves on water.
    Windy {
        /// Texture space from world.
        texture_from_world: Transform,
    },
    /// Marble veins.
    Marble {
        /// Texture space from world.
        texture_from_world: Transform,
        /// Octaves.
        octaves: u32,
        /// Ratio of successive amplitudes.
        omega: f32,
        /// Frequency.
        scale: f32,
        /// How much the noise displaces the veins.
        variation: f32,
    },
}

/// How a hit becomes a 2D texture coordinate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Mapping2D {
    /// (su·u + du, sv·v + dv).
    Uv {
        /// Scale.
        scale: Vec2,
        /// Offset.
        delta: Vec2,
    },
    /// Angles of the position on a sphere around the texture space's origin.
    Spherical(Transform),
    /// Angle and height around the texture space's z axis.
    Cylindrical(Transform),
    /// Projection onto two axes, in texture space.
    Planar {
        /// Texture space from world.
        texture_from_world: Transform,
        /// First axis.
        vs: Vec3,
        /// Second axis.
        vt: Vec3,
        /// Offsets.
        delta: Vec2,
    },
}

/// 2D or 3D texture domain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Mapping {
    /// Two dimensions.
    Two(Mapping2D),
    /// Three: texture space from world.
    Three(Transform),
}

/// An image as a texture.
#[derive(Clone, Debug)]
pub struct ImageTexture {
    /// The file, resolved against the scene file's folder.
    pub path: PathBuf,
    /// Domain.
    pub mapping: Mapping2D,
    /// Beyond [0, 1].
    pub wrap: Wrap,
    /// Interpolation.
    pub filter: TextureFilter,
    /// How stored numbers become linear ones; `None`: sRGB for 8-bit images, linear otherwise.
    pub encoding: Option<Encoding>,
    /// Multiplies the value.
    pub scale: f32,
    /// 1 − scaled value, not below 0.
    pub invert: bool,
    /// A float texture: the mean of the channels rather than RGB.
    pub monochrome: bool,
}

/// What an image shows beyond its edges.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wrap {
    /// Repeats.
    #[default]
    Repeat,
    /// Black.
    Black,
    /// The nearest edge texel.
    Clamp,
    /// Equal-area octahedral: crosses to the mirrored side.
    OctahedralSphere,
}

/// How texels are interpolated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TextureFilter {
    /// Nearest texel.
    Point,
    /// Bilinear at the finest level.
    #[default]
    Bilinear,
    /// Bilinear on two levels.
    Trilinear,
    /// Elliptically weighted.
    Ewa,
}

/// Transfer function of stored texels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Encoding {
    /// sRGB.
    Srgb,
    /// None.
    Linear,
    /// value^gamma.
    Gamma(f32),
}

/// One material.
#[derive(Clone, Debug)]
pub struct Material {
    /// Its name in the file, if it has one.
    pub name: Option<String>,
    /// What it is made of.
    pub kind: MaterialKind,
    /// Offset along the normal (bump mapping).
    pub displacement: Option<TextureId>,
    /// Tangent-space normal map.
    pub normal_map: Option<PathBuf>,
    /// Where it was described.
    pub span: Span,
}

/// Roughness of a GGX interface along both tangents.
#[derive(Clone, Debug, PartialEq)]
pub struct Roughness {
    /// Along the first tangent.
    pub u: Value<f32>,
    /// Along the second.
    pub v: Value<f32>,
    /// The values are an artist's roughness, alpha = √roughness; else they are alpha.
    pub remap: bool,
}

/// Reflectance of a conductor.
#[derive(Clone, Debug)]
pub enum Conductor {
    /// Complex refractive index η − ik by wavelength.
    EtaK {
        /// Real part.
        eta: Value<Spectrum>,
        /// Extinction.
        k: Value<Spectrum>,
    },
    /// η = 1 and the k that gives this reflectance at normal incidence.
    Reflectance(Value<Rgb>),
}

/// The coat of a layered material.
#[derive(Clone, Debug)]
pub struct Coat {
    /// Of the outer interface.
    pub roughness: Roughness,
    /// Distance between the interfaces, in units of mean free path 1 (see pbrt's `thickness`).
    pub thickness: Value<f32>,
    /// Relative refractive index of the coat.
    pub eta: f32,
    /// Asymmetry of the scattering between the interfaces.
    pub g: Value<f32>,
    /// Albedo of the scattering between the interfaces.
    pub albedo: Value<Rgb>,
}

/// What a material is made of: pbrt's models by pbrt's parameters.
#[derive(Clone, Debug)]
pub enum MaterialKind {
    /// No surface: an interface between media.
    Interface,
    /// Lambertian.
    Diffuse {
        /// Albedo.
        reflectance: Value<Rgb>,
    },
    /// Lambertian under a dielectric coat.
    CoatedDiffuse {
        /// Albedo of the base.
        reflectance: Value<Rgb>,
        /// The coat.
        coat: Coat,
    },
    /// Metal under a dielectric coat.
    CoatedConductor {
        /// The base.
        conductor: Conductor,
        /// Of the base.
        conductor_roughness: Roughness,
        /// The coat.
        coat: Coat,
    },
    /// Metal.
    Conductor {
        /// The metal.
        conductor: Conductor,
        /// Of its surface.
        roughness: Roughness,
    },
    /// Glass.
    Dielectric {
        /// Refractive index inside.
        eta: f32,
        /// Of its surface.
        roughness: Roughness,
    },
    /// A pane: both interfaces at once.
    ThinDielectric {
        /// Refractive index inside.
        eta: f32,
    },
    /// Lambertian on both sides.
    DiffuseTransmission {
        /// Albedo of reflection.
        reflectance: Value<Rgb>,
        /// Albedo of transmission.
        transmittance: Value<Rgb>,
    },
    /// One of two, chosen by a weight.
    Mix {
        /// At amount 0 and 1.
        materials: [MaterialId; 2],
        /// Probability of the second.
        amount: Value<f32>,
    },
}

/// A light that is not a shape.
#[derive(Clone, Debug)]
pub struct Light {
    /// World space from the light's.
    pub world_from_light: Transform,
    /// Kind and parameters.
    pub kind: LightKind,
    /// The group of lights that it belongs to.
    pub group: Option<Arc<str>>,
    /// Where it was described.
    pub span: Span,
}

/// Kinds of lights. Intensities in W/sr, radiances in W/(sr m²), irradiances in W/m², in film RGB. Where the file gives a
/// power or an illuminance too, `power` or `illuminance` holds it: that is the one of an emission of luminance 1, and the
/// level of the other still multiplies it, as in pbrt.
#[derive(Clone, Debug)]
pub enum LightKind {
    /// The same in all directions.
    Point {
        /// Intensity.
        intensity: Rgb,
        /// Position in light space.
        from: Vec3,
        /// Total power.
        power: Option<f32>,
    },
    /// A cone with a smooth edge.
    Spot {
        /// Intensity on the axis.
        intensity: Rgb,
        /// Position in light space.
        from: Vec3,
        /// A point on the axis.
        to: Vec3,
        /// Degrees: half angle of the cone.
        cone_angle: f32,
        /// Degrees: width of its edge, inwards.
        cone_delta_angle: f32,
        /// Total power.
        power: Option<f32>,
    },
    /// Parallel light.
    Distant {
        /// Radiance (per unit solid angle of a delta: irradiance orthogonal to it).
        radiance: Rgb,
        /// Light travels from here,
        from: Vec3,
        /// to here.
        to: Vec3,
        /// Irradiance that overrides the level.
        illuminance: Option<f32>,
    },
    /// An environment.
    Infinite {
        /// Uniform radiance, or the factor of the image.
        radiance: Rgb,
        /// Equal-area octahedral image.
        image: Option<PathBuf>,
        /// Irradiance on an upward surface that overrides the level.
        illuminance: Option<f32>,
        /// Corners of a portal, through which alone the light comes. Empty: none. Not rendered.
        portal: Vec<Vec3>,
    },
    /// A point with an equal-area goniometric image.
    Goniometric {
        /// Factor of the image.
        intensity: Rgb,
        /// The image.
        image: Option<PathBuf>,
        /// Total power.
        power: Option<f32>,
    },
    /// A slide projector along +z.
    Projection {
        /// Factor of the image.
        scale: Rgb,
        /// The image.
        image: PathBuf,
        /// Degrees, across the shorter side.
        fov: f32,
        /// Total power.
        power: Option<f32>,
    },
}

/// Emission of a shape.
#[derive(Clone, Debug)]
pub struct AreaLight {
    /// Radiance, or the factor of the image.
    pub radiance: Rgb,
    /// Image over the shape's uv.
    pub image: Option<PathBuf>,
    /// Emits on both sides.
    pub two_sided: bool,
    /// Total power that overrides the level.
    pub power: Option<f32>,
    /// The group of lights that it belongs to.
    pub group: Option<Arc<str>>,
    /// Where it was described.
    pub span: Span,
}

/// A participating medium.
#[derive(Clone, Debug)]
pub struct Medium {
    /// Its name in the file.
    pub name: String,
    /// pbrt's type name.
    pub kind: String,
    /// Where it was described.
    pub span: Span,
}

/// One shape.
#[derive(Clone, Debug)]
pub struct Shape {
    /// World space (object space within an [`Object`]) from the shape's own.
    pub world_from_shape: Transform,
    /// The file asked to flip the surface's orientation.
    pub reverse_orientation: bool,
    /// Geometry.
    pub kind: ShapeKind,
    /// Material.
    pub material: MaterialId,
    /// Emission.
    pub area_light: Option<AreaLightId>,
    /// Probability of a hit being real.
    pub alpha: Option<Value<f32>>,
    /// Its name, if it has one.
    pub name: Option<Arc<str>>,
    /// Medium inside and outside.
    pub media: [Option<MediumId>; 2],
    /// Where it was described.
    pub span: Span,
}

/// Geometry of a shape, by pbrt's parameters. Indices are not yet checked.
#[derive(Clone, Debug)]
pub enum ShapeKind {
    /// Triangles.
    Triangles(TriangleMesh),
    /// A file with triangles and quads.
    Ply {
        /// The file, resolved.
        path: PathBuf,
        /// Texture that displaces the vertices: not rendered.
        displacement: Option<TextureId>,
    },
    /// Bilinear patches, four corner indices each: p00 p10 p01 p11.
    Bilinear(BilinearMesh),
    /// Loop subdivision surface.
    Loop {
        /// Subdivisions before the limit is taken.
        levels: u32,
        /// Control mesh.
        mesh: TriangleMesh,
    },
    /// Sphere around the origin.
    Sphere {
        /// Radius.
        radius: f32,
        /// Lower cut.
        z_min: f32,
        /// Upper cut.
        z_max: f32,
        /// Degrees of the sweep.
        phi_max: f32,
    },
    /// Disk around the z axis.
    Disk {
        /// Height on the z axis.
        height: f32,
        /// Outer radius.
        radius: f32,
        /// Inner radius.
        inner_radius: f32,
        /// Degrees of the sweep.
        phi_max: f32,
    },
    /// Open cylinder around the z axis.
    Cylinder {
        /// Radius.
        radius: f32,
        /// Lower end.
        z_min: f32,
        /// Upper end.
        z_max: f32,
        /// Degrees of the sweep.
        phi_max: f32,
    },
    /// One curve of one or more segments.
    Curve(Curve),
}

/// Triangles.
#[derive(Clone, Debug, Default)]
pub struct TriangleMesh {
    /// Vertex indices.
    pub indices: Vec<[u32; 3]>,
    /// Positions, shape space.
    pub positions: Vec<Vec3>,
    /// Per vertex, or empty. Shape space.
    pub normals: Vec<Vec3>,
    /// Per vertex, or empty.
    pub uvs: Vec<Vec2>,
    /// Tangents per vertex, or empty. Shape space.
    pub tangents: Vec<Vec3>,
}

/// Bilinear patches.
#[derive(Clone, Debug, Default)]
pub struct BilinearMesh {
    /// Corner indices p00 p10 p01 p11.
    pub indices: Vec<[u32; 4]>,
    /// Positions, shape space.
    pub positions: Vec<Vec3>,
    /// Per vertex, or empty. Shape space.
    pub normals: Vec<Vec3>,
    /// Per vertex, or empty.
    pub uvs: Vec<Vec2>,
}

/// A curve.
#[derive(Clone, Debug)]
pub struct Curve {
    /// Cross section.
    pub kind: CurveKind,
    /// Control points of all segments as cubic Bézier, 4 each, shape space.
    pub control: Vec<[Vec3; 4]>,
    /// Normals at the segments' ends, for ribbons.
    pub normals: Vec<Vec3>,
    /// Width at the start and at the end.
    pub width: [f32; 2],
}

/// Cross section of a curve.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CurveKind {
    /// Faces the ray.
    Flat,
    /// Faces the ray, shaded as a cylinder.
    Cylinder,
    /// Oriented by its normals.
    Ribbon,
}

/// A named group of shapes.
#[derive(Clone, Debug)]
pub struct Object {
    /// Its name in the file.
    pub name: Arc<str>,
    /// Its shapes, in object space. They have no area lights.
    pub shapes: Vec<Shape>,
    /// Where it was described.
    pub span: Span,
}

/// A placed copy of an object.
#[derive(Clone, Copy, Debug)]
pub struct Instance {
    /// Which.
    pub object: ObjectId,
    /// Where.
    pub world_from_object: Transform,
    /// Where it was described.
    pub span: Span,
}
