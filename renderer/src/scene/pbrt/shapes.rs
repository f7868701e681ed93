//! Shapes: `Shape "type"`.

use glam::Vec3;

use super::context::Context;
use super::params::Params;
use crate::scene::description::{BilinearMesh, Curve, CurveKind, ShapeKind, TriangleMesh, Value};

const TYPES: [&str; 8] =
    ["sphere", "cylinder", "disk", "trianglemesh", "plymesh", "bilinearmesh", "loopsubdiv", "curve"];

/// Builds the geometry of a shape. `None` after an error.
pub(super) fn build(cx: &mut Context, params: &mut Params) -> Option<ShapeKind> {
    match params.name.as_str() {
        "sphere" => {
            let radius = params.positive(cx, "radius", 1.0);
            let (z_min, z_max) = (params.float(cx, "zmin", -radius), params.float(cx, "zmax", radius));
            Some(ShapeKind::Sphere {
                radius,
                z_min: z_min.min(z_max).clamp(-radius, radius),
                z_max: z_min.max(z_max).clamp(-radius, radius),
                phi_max: phi_max(cx, params),
            })
        }
        "cylinder" => {
            let radius = params.positive(cx, "radius", 1.0);
            let (z_min, z_max) = (params.float(cx, "zmin", -1.0), params.float(cx, "zmax", 1.0));
            let (z_min, z_max) = (z_min.min(z_max), z_min.max(z_max));
            Some(ShapeKind::Cylinder { radius, z_min, z_max, phi_max: phi_max(cx, params) })
        }
        "disk" => {
            let radius = params.positive(cx, "radius", 1.0);
            let inside = |r: f32| (0.0..radius).contains(&r);
            Some(ShapeKind::Disk {
                height: params.float(cx, "height", 0.0),
                radius,
                inner_radius: params.float_where(cx, "innerradius", 0.0, "at least 0 and less than the radius", inside),
                phi_max: phi_max(cx, params),
            })
        }
        "trianglemesh" => triangle_mesh(cx, params),
        "plymesh" => ply(cx, params),
        "bilinearmesh" => bilinear_mesh(cx, params),
        "loopsubdiv" => loop_subdivision(cx, params),
        "curve" => curve(cx, params),
        name => {
            let name = name.to_owned();
            cx.unknown_type("shape", &name, params.span, &TYPES);
            params.ignore_all();
            None
        }
    }
}

/// The probability that a hit is real, where it is not always.
pub(super) fn alpha(cx: &mut Context, params: &mut Params) -> Option<Value<f32>> {
    params.opt_float_texture(cx, "alpha").filter(|alpha| !matches!(alpha, Value::Constant(value) if *value >= 1.0))
}

fn phi_max(cx: &mut Context, params: &mut Params) -> f32 {
    params.float_where(cx, "phimax", 360.0, "more than 0", |phi| phi > 0.0).min(360.0)
}

/// Vertex indices in groups of `N`. `None` after an error.
fn indices<const N: usize>(cx: &mut Context, params: &mut Params, vertices: usize) -> Option<Vec<[u32; N]>> {
    let Some(indices) = params.ints(cx, "indices") else {
        // One triangle or patch needs no indices.
        let implied = (vertices == N).then(|| vec![std::array::from_fn(|i| i as u32)]);
        if implied.is_none() && !params.has("indices") {
            cx.report.error(params.span, format!("shape \"{}\" needs \"integer indices\"", params.name));
        }
        return implied;
    };
    let span = params.span_of("indices");
    if indices.len() % N != 0 {
        cx.report.error(span, format!("the number of \"indices\", {}, is not a multiple of {N}", indices.len()));
        return None;
    }
    let outside = |index: i32| usize::try_from(index).map_or(true, |index| index >= vertices);
    if let Some(at) = indices.iter().position(|&index| outside(index)) {
        let text = format!("index {at} names vertex {}, but there are {vertices}, from 0", indices[at]);
        cx.report.error(span, text);
        return None;
    }
    Some(indices.chunks_exact(N).map(|group| std::array::from_fn(|i| group[i] as u32)).collect())
}

/// Checks that there is one of a per-vertex value for each vertex, or none at all.
fn per_vertex<T>(cx: &mut Context, params: &Params, name: &str, values: Vec<T>, vertices: usize) -> Vec<T> {
    if values.is_empty() || values.len() == vertices {
        return values;
    }
    let text = format!("\"{name}\" has {} values for {vertices} vertices", values.len());
    cx.report.error(params.span_of(name), text);
    Vec::new()
}

fn positions(cx: &mut Context, params: &mut Params) -> Option<Vec<Vec3>> {
    let positions = params.point3s(cx, "P");
    if positions.is_empty() && !params.has("P") {
        cx.report.error(params.span, format!("shape \"{}\" needs \"point3 P\"", params.name));
    }
    (!positions.is_empty()).then_some(positions)
}

fn triangle_mesh(cx: &mut Context, params: &mut Params) -> Option<ShapeKind> {
    // Numbers of the faces, for ptex.
    params.ignore(&["faceIndices"]);
    let (uvs, normals) = (params.point2s(cx, "uv"), params.normals(cx, "N"));
    let tangents = params.vector3s(cx, "S");
    let Some(positions) = positions(cx, params) else {
        params.ignore(&["indices"]);
        return None;
    };
    let vertices = positions.len();
    let indices = indices(cx, params, vertices);
    Some(ShapeKind::Triangles(TriangleMesh {
        indices: indices?,
        normals: per_vertex(cx, params, "N", normals, vertices),
        uvs: per_vertex(cx, params, "uv", uvs, vertices),
        tangents: per_vertex(cx, params, "S", tangents, vertices),
        positions,
    }))
}

fn bilinear_mesh(cx: &mut Context, params: &mut Params) -> Option<ShapeKind> {
    params.ignore(&["faceIndices"]);
    if params.has("emissionfilename") {
        let text = "\"emissionfilename\" only guides the sampling of an emitter in pbrt: the light is the same without";
        cx.report.warning("emissionfilename", params.span_of("emissionfilename"), text);
        params.ignore(&["emissionfilename"]);
    }
    let (uvs, normals) = (params.point2s(cx, "uv"), params.normals(cx, "N"));
    let Some(positions) = positions(cx, params) else {
        params.ignore(&["indices"]);
        return None;
    };
    let vertices = positions.len();
    let indices = indices(cx, params, vertices);
    Some(ShapeKind::Bilinear(BilinearMesh {
        indices: indices?,
        normals: per_vertex(cx, params, "N", normals, vertices),
        uvs: per_vertex(cx, params, "uv", uvs, vertices),
        positions,
    }))
}

fn ply(cx: &mut Context, params: &mut Params) -> Option<ShapeKind> {
    params.ignore(&["displacement.edgelength"]);
    let displacement = params.only_float_texture(cx, "displacement");
    if displacement.is_some() {
        let text = "displaced meshes are not rendered: the mesh is drawn as its file has it";
        cx.report.warning("displaced mesh", params.span_of("displacement"), text);
    }
    Some(ShapeKind::Ply { path: params.needed_path(cx)?, displacement })
}

fn loop_subdivision(cx: &mut Context, params: &mut Params) -> Option<ShapeKind> {
    // There is one scheme.
    params.ignore(&["scheme"]);
    // Each level has four times the triangles of the one before it.
    let levels = params.int(cx, "levels", 3, 0..=10);
    let Some(positions) = positions(cx, params) else {
        params.ignore(&["indices"]);
        return None;
    };
    let mesh = TriangleMesh { indices: indices(cx, params, positions.len())?, positions, ..TriangleMesh::default() };
    Some(ShapeKind::Loop { levels, mesh })
}

#[derive(Clone, Copy, PartialEq)]
enum Basis {
    Bezier,
    BSpline,
}

fn curve(cx: &mut Context, params: &mut Params) -> Option<ShapeKind> {
    // How finely pbrt splits a curve to find its hits.
    params.ignore(&["splitdepth"]);
    let mut width = |name, default| params.float_where(cx, name, default, "at least 0", |width| width >= 0.0);
    let both = width("width", 1.0);
    let width = [width("width0", both), width("width1", both)];
    let degree = params.int(cx, "degree", 3, 2..=3) as usize;
    let basis = params.choice(cx, "basis", &[("bezier", Basis::Bezier), ("bspline", Basis::BSpline)]);
    let kinds = [("flat", CurveKind::Flat), ("cylinder", CurveKind::Cylinder), ("ribbon", CurveKind::Ribbon)];
    let kind = params.choice(cx, "type", &kinds);
    let normals = params.normals(cx, "N");
    let points = positions(cx, params)?;

    // Bézier segments share their end points; each further point of a B-spline begins a segment.
    let fits = match basis {
        Basis::Bezier => points.len() > degree && (points.len() - 1) % degree == 0,
        Basis::BSpline => points.len() > degree,
    };
    if !fits {
        let (name, need) = match basis {
            Basis::Bezier => ("Bézier curve", format!("{} points and {degree} for each further segment", degree + 1)),
            Basis::BSpline => ("B-spline", format!("at least {} points", degree + 1)),
        };
        let text = format!("a {name} of degree {degree} has {need}, not {}", points.len());
        cx.report.error(params.span_of("P"), text);
        return None;
    }
    let step = if basis == Basis::Bezier { degree } else { 1 };
    let control: Vec<[Vec3; 4]> =
        points.windows(degree + 1).step_by(step).map(|points| cubic_bezier(points, basis)).collect();
    let normals = match kind {
        CurveKind::Ribbon if normals.len() == control.len() + 1 => normals,
        CurveKind::Ribbon => {
            let text = format!(
                "a ribbon of {} segments needs a normal \"N\" at each of their ends, not {}",
                control.len(),
                normals.len()
            );
            cx.report.error(params.span_of("N"), text);
            return None;
        }
        _ if !normals.is_empty() => {
            let text = "only curves of type \"ribbon\" have normals \"N\": ignored";
            cx.report.warning("curve normals", params.span_of("N"), text);
            Vec::new()
        }
        _ => normals,
    };
    Some(ShapeKind::Curve(Curve { kind, control, normals, width }))
}

/// A segment given by its 3 or 4 points in a basis, as cubic Bézier.
///
/// **Source**: \[Farin01\], degree elevation and knot insertion in uniform B-splines.
fn cubic_bezier(points: &[Vec3], basis: Basis) -> [Vec3; 4] {
    let elevated = |[a, b, c]: [Vec3; 3]| [a, a.lerp(b, 2.0 / 3.0), b.lerp(c, 1.0 / 3.0), c];
    match (basis, points) {
        (Basis::Bezier, &[a, b, c]) => elevated([a, b, c]),
        (Basis::BSpline, &[a, b, c]) => elevated([a.lerp(b, 0.5), b, b.lerp(c, 0.5)]),
        (Basis::Bezier, &[a, b, c, d]) => [a, b, c, d],
        (Basis::BSpline, &[a, b, c, d]) => {
            let (bc, cb) = (b.lerp(c, 1.0 / 3.0), b.lerp(c, 2.0 / 3.0));
            [a.lerp(b, 2.0 / 3.0).lerp(bc, 0.5), bc, cb, cb.lerp(c.lerp(d, 1.0 / 3.0), 0.5)]
        }
        _ => unreachable!("a window has degree + 1 points and the degree is 2 or 3"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The uniform cubic B-spline in matrix form at parameter `t` of a segment.
    fn b_spline(p: [Vec3; 4], t: f32) -> Vec3 {
        let s = 1.0 - t;
        let weights =
            [s * s * s, 3.0 * t * t * t - 6.0 * t * t + 4.0, -3.0 * t * t * t + 3.0 * t * t + 3.0 * t + 1.0, t * t * t];
        p.iter().zip(weights).map(|(p, w)| *p * (w / 6.0)).sum()
    }

    fn bezier(p: [Vec3; 4], t: f32) -> Vec3 {
        let s = 1.0 - t;
        p[0] * (s * s * s) + p[1] * (3.0 * s * s * t) + p[2] * (3.0 * s * t * t) + p[3] * (t * t * t)
    }

    #[test]
    fn a_b_spline_segment_is_the_same_curve_as_bezier() {
        let points = [Vec3::ZERO, Vec3::new(1.0, 2.0, 0.0), Vec3::new(3.0, -1.0, 1.0), Vec3::new(4.0, 0.0, 5.0)];
        let converted = cubic_bezier(&points, Basis::BSpline);
        for t in [0.0, 0.25, 0.5, 1.0] {
            assert!((bezier(converted, t) - b_spline(points, t)).length() < 1e-5);
        }
    }

    #[test]
    fn a_quadratic_keeps_its_shape_when_elevated() {
        let [a, b, c] = [Vec3::ZERO, Vec3::new(1.0, 2.0, 0.0), Vec3::new(3.0, -1.0, 1.0)];
        let converted = cubic_bezier(&[a, b, c], Basis::Bezier);
        for t in [0.0, 0.3, 1.0_f32] {
            let s = 1.0 - t;
            let quadratic = a * (s * s) + b * (2.0 * s * t) + c * (t * t);
            assert!((bezier(converted, t) - quadratic).length() < 1e-6);
        }
        assert_eq!(cubic_bezier(&[a, b, c], Basis::BSpline)[0], (a + b) * 0.5);
    }
}
