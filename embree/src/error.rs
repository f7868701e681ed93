//! What can go wrong while a device is opened and scenes are built; queries never fail.

use crate::Isa;

/// Why Embree, or this crate on its behalf, refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Error {
    /// No device could be made.
    #[error(
        "Embree could not start with {isa:?}: {message}; choose Isa::Native where the processor is older than 2013"
    )]
    Device {
        /// The instruction set that was asked for.
        isa: Isa,
        /// Embree's words.
        message: String,
    },
    /// Embree's builder threads belong to the process, and another device has fixed their number.
    #[error(
        "a device with {running} builder threads is alive, so one with {asked} cannot be made: use the same number"
    )]
    BuilderThreads {
        /// The number asked for.
        asked: usize,
        /// The number with which the living devices run.
        running: usize,
    },
    /// A call into Embree failed, for want of memory as a rule.
    #[error("Embree's {call} failed with {code}: {message}")]
    Embree {
        /// The C function that failed.
        call: &'static str,
        /// Embree's name of the error.
        code: String,
        /// Embree's words.
        message: String,
    },
    /// Vertices, indices or control points that cannot be traced.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// An instance of a scene that itself holds instances; Debian's Embree is built for one level.
    #[error("the instanced scene itself holds instances, but Embree traces one level: flatten the inner ones")]
    NestedInstance,
    /// A transform that has no inverse, or one that is not finite.
    #[error("the transform of an instance has no finite inverse: {transform:?}")]
    SingularTransform {
        /// The offending `world_from_object`.
        transform: glam::Affine3A,
    },
    /// An instance of a scene that was made by another device.
    #[error("the instanced scene was made by another device than its instance: make both with the same device")]
    ForeignScene,
    /// A geometry that was made by another device than the scene it is attached to.
    #[error("geometry {geometry} was made by another device than its scene: make both with the same device")]
    ForeignGeometry {
        /// Its number in the scene.
        geometry: u32,
    },
}

/// Why a buffer cannot be traced: Embree would drop such primitives silently, or read outside the buffer.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum MeshError {
    /// A NaN or infinite coordinate.
    #[error("vertex {vertex} is not finite: {position:?}")]
    NonFiniteVertex {
        /// Its number.
        vertex: usize,
        /// Its coordinates.
        position: [f32; 3],
    },
    /// A coordinate beyond 1.844e18, where squared distances overflow.
    #[error("vertex {vertex} is farther from the origin than 1.844e18: {position:?}")]
    FarVertex {
        /// Its number.
        vertex: usize,
        /// Its coordinates.
        position: [f32; 3],
    },
    /// An index of a vertex that does not exist.
    #[error("triangle {triangle} names vertex {index}, but there are {vertex_count}")]
    IndexOutOfRange {
        /// Number of the triangle.
        triangle: usize,
        /// The index that it holds.
        index: u32,
        /// The number of vertices.
        vertex_count: usize,
    },
    /// Indices that were checked against more vertices than the buffer has that they are used with.
    #[error("the indices were checked against {checked} vertices, but the buffer holds {vertex_count}")]
    FewerVertices {
        /// The number of vertices with which the indices were made.
        checked: usize,
        /// The number of vertices of the buffer.
        vertex_count: usize,
    },
    /// More data than Embree can address.
    #[error("{count} {what} are too many: Embree takes at most {limit}")]
    TooMany {
        /// Of what.
        what: &'static str,
        /// How many.
        count: usize,
        /// How many there may be.
        limit: usize,
    },
    /// A curve whose four control points do not all exist.
    #[error("curve {curve} begins at control point {first} and needs four, but there are {count}")]
    CurveOutOfRange {
        /// Number of the curve.
        curve: usize,
        /// Number of its first control point.
        first: u32,
        /// The number of control points.
        count: usize,
    },
    /// A control radius that is not finite.
    #[error("the radius of control point {point} is not finite: {radius}")]
    NonFiniteRadius {
        /// Number of the control point.
        point: usize,
        /// Its radius.
        radius: f32,
    },
    /// Normals missing where the kind of curve needs them, present where it has none, or of another number.
    #[error("curves of this kind need {needed} normals, but {count} are given")]
    CurveNormals {
        /// How many there must be: one for each control point, or none.
        needed: usize,
        /// How many there are.
        count: usize,
    },
    /// Bounds of a user primitive that Embree would silently ignore.
    #[error("the bounds of user primitive {primitive} are not finite and ordered: {lower:?} to {upper:?}")]
    UserBounds {
        /// Number of the primitive.
        primitive: usize,
        /// The lower corner.
        lower: [f32; 3],
        /// The upper corner.
        upper: [f32; 3],
    },
}
