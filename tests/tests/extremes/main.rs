//! Scenes where numbers get strange: very large, very small, degenerate, or not there at all.
//!
//! Each test is a case with an answer that is known: a closed form, an invariance, or a message. What renders must be
//! finite and lose no sample; what cannot must say why and where. Every case prints its figure.
#![allow(clippy::print_stdout, reason = "tests print the figures that they judge")]

mod camera;
mod dielectric;
mod energy;
mod geometry;
mod image;
mod light;
mod limits;
mod mesh;
mod roughness;
mod scale;
mod scene;
mod strange;
mod support;
mod texture;
mod transform;
