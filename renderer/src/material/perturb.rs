//! Shading normals that a material bends.

use glam::{Vec2, Vec3};

use super::Surface;
use crate::math::{Frame, Rgb, unit};
use crate::scene::description::{TextureId, Value, Wrap};
use crate::texture::{Pyramid, TexturePoint, Textures};

/// Step in u and v where there is no footprint: small against most features of textures, large against rounding.
///
/// **Source**: pbrt-v4, by behaviour.
const STEP_WITHOUT_FOOTPRINT: f32 = 0.0005;

/// Normal and tangent of the surface that `displacement` moves along the shading normal, on the side of the geometric
/// normal; the displacement itself is not applied.
///
/// **Source**: \[Blinn78\], by finite differences half a footprint apart. What the displacement times the curvature of
/// the surface would add is left out.
pub fn bump(at: &Surface, displacement: TextureId, textures: &Textures) -> (Vec3, Vec3) {
    let point = &at.texture_point;
    let height = |point: &TexturePoint| textures.float(&Value::Texture(displacement), point);
    let step = |x: f32, y: f32| {
        let step = 0.5 * (x.abs() + y.abs());
        if step > 0.0 { step } else { STEP_WITHOUT_FOOTPRINT }
    };
    let du = step(point.duvdx.x, point.duvdy.x);
    let dv = step(point.duvdx.y, point.duvdy.y);
    let here = height(point);
    let beside_u = height(&TexturePoint { p: point.p + du * at.dpdu, uv: point.uv + Vec2::new(du, 0.0), ..*point });
    let beside_v = height(&TexturePoint { p: point.p + dv * at.dpdv, uv: point.uv + Vec2::new(0.0, dv), ..*point });
    // Derivatives on the smooth surface that the shading normals describe.
    let tangential = |v: Vec3| v - at.ns * at.ns.dot(v);
    let dpdu = tangential(at.dpdu) + at.ns * ((beside_u - here) / du);
    let dpdv = tangential(at.dpdv) + at.ns * ((beside_v - here) / dv);
    match unit(dpdu.cross(dpdv)) {
        Some(ns) => (towards(ns, at.ng), dpdu),
        None => (at.ns, at.dpdu),
    }
}

/// The normal that a tangent-space normal map gives, on the side of the geometric normal; bilinear, repeated beyond [0, 1].
///
/// **Source**: pbrt-v4, by behaviour: (r, g, b) ↦ 2(r, g, b) − 1 in the frame of the shading normal and ∂p/∂u.
pub fn normal_map(at: &Surface, map: &Pyramid) -> Vec3 {
    let uv = at.texture_point.uv;
    let st = Vec2::new(uv.x, 1.0 - uv.y);
    let bent = 2.0 * map.bilinear(st, Wrap::Repeat) - Rgb::ONE;
    let frame = Frame::from_normal_and_tangent(at.ns, at.dpdu);
    match unit(frame.s * bent.x + frame.t * bent.y + frame.n * bent.z) {
        Some(ns) => towards(ns, at.ng),
        None => at.ns,
    }
}

/// `ns` or its opposite, whichever is on the side of `ng`.
fn towards(ns: Vec3, ng: Vec3) -> Vec3 {
    if ns.dot(ng) < 0.0 { -ns } else { ns }
}
