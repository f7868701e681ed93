//! Embree 4, made safe: the only door through which rays are traced.
//!
//! A [`Device`] makes [`Geometry`]; geometry is attached to a [`SceneBuilder`]; [`SceneBuilder::commit`] consumes the
//! builder and returns a [`CommittedScene`], which any number of threads may query and nobody can change.
//!
//! ```
//! use embree::{Device, DeviceOptions, Geometry, Ray, SceneBuilder, SceneOptions, TriangleIndices, VertexBuffer};
//! use glam::Vec3;
//!
//! let device = Device::new(&DeviceOptions::default())?;
//! let vertices = VertexBuffer::new(vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])?;
//! let triangles = TriangleIndices::new(vec![[0, 1, 2]], vertices.len())?;
//! let mut builder = SceneBuilder::new(&device, SceneOptions::default());
//! let mesh = builder.attach(Geometry::triangles(&device, vertices, triangles)?);
//! let scene = builder.commit()?;
//!
//! let ray = Ray::new(Vec3::new(0.25, 0.25, 1.0), -Vec3::Z);
//! let hit = scene.intersect(&ray).expect("the ray points at the triangle");
//! assert_eq!((hit.geometry, hit.primitive), (mesh, 0));
//! assert!((hit.t - 1.0).abs() < 1e-6);
//! # Ok::<(), embree::Error>(())
//! ```
//!
//! # Notation
//! | symbol | meaning |
//! |---|---|
//! | `t` | distance along the ray in units of its direction's length |
//! | `u`, `v` | barycentric weights of a triangle's second and third vertex; the surface parameters of other shapes |
//! | `ng` | geometric normal, not normalised, in the space of the object that was hit |
//! | `geometry`, `primitive`, `instance` | number of the geometry in its scene, of the primitive in it, of the instance in the top scene |
//!
//! # Invariants
//! A committed scene is never modified and keeps alive all that it reads. Every query is passed the features that the
//! scene holds, and no others. No Rust panic crosses Embree: one in a callback resumes on the thread that asked, after
//! Embree has returned. The floating-point control register is left alone: Rust forbids changing it, so denormal
//! numbers are not flushed while rays are traced.

mod buffer;
mod callback;
mod curves;
mod device;
mod error;
mod features;
mod geometry;
mod packet;
mod query;
mod scene;
mod user;

pub use buffer::{TriangleIndices, VertexBuffer};
pub use curves::CurveKind;
pub use device::{Device, DeviceOptions, Isa, MemoryUse};
pub use error::{Error, MeshError};
pub use features::Features;
pub use geometry::Geometry;
pub use query::{Hit, HitFilter, Ray};
pub use scene::{BuildQuality, CommittedScene, SceneBuilder, SceneOptions};
pub use user::{UserGeometry, UserHit};
