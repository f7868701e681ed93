//! From a scene file to a film: unidirectional path tracing through Embree.
//!
//! The data goes one straight way: scene file → [`scene`] description → [`compile`]d world → [`integrator`] paths →
//! [`film`]. [`render`] is that line in code; read it first.
//!
//! # Notation
//! | symbol | meaning |
//! |---|---|
//! | `wo`, `wi` | unit directions, both pointing away from the surface; `wo` towards the eye |
//! | `p`, `ng`, `ns`, `uv` | hit point, geometric normal, shading normal, surface parameters |
//! | `f`, `le`, `beta` | BSDF value (sr⁻¹), emitted radiance, path throughput |
//! | `eta` | ratio of refractive indices, inside (opposite the normal) over outside |
//! | `alpha`, `roughness` | width of the GGX distribution; the artist's value that maps to it |
//! | `pdf`, `pmf`, `spp` | density, probability, samples per pixel |
//! | `world_from_object` | the transform that takes object to world coordinates |
//!
//! # Invariants
//! Modules are declared in the order in which they may use each other: each uses only what stands above it. Nothing
//! before `interaction` knows Embree; nothing after `compile` knows the scene file, or fails on input. There is no
//! global epsilon, no clock that a pixel could depend on, and no `unsafe`.
#![forbid(unsafe_code)]

pub mod math;
pub mod sampling;
pub mod spectrum;
pub mod scene;
pub mod shape;
pub mod texture;
pub mod camera;
pub mod bsdf;
pub mod material;
pub mod light;
pub mod interaction;
pub mod world;
pub mod compile;
pub mod integrator;
pub mod draft;
pub mod film;
pub mod filtering;
pub mod frame;
pub mod part;
pub mod error;
pub mod render;
