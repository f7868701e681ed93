//! Which light a light sample goes to: a tree over all lights of finite extent.
//!
//! Each node knows eight groups of lights by where they are, whither they shine and how much; from these follows a bound
//! of what a group can send to a receiver, and the walk from the root takes each branch with a probability proportional to
//! it. Up to eight lights are a single node; one light is no node at all.
//!
//! **Source**: \[Conty18\], with the wide nodes of \[Wald08\].

use glam::Vec3;

use super::Receiver;
use super::bounds::LightBounds;
use super::choose::choose;

pub(super) mod build;

/// Groups in a node.
pub(super) const WIDTH: usize = 8;
/// Marks a link to a light instead of a node.
const LEAF: u32 = 1 << 31;
/// A light that is not in the tree; the parent of the root.
const NONE: u32 = u32::MAX;

/// Chooses among lights by how much of theirs a receiver may get.
#[derive(Clone, Debug, Default)]
pub struct LightTree {
    nodes: Vec<Node>,
    /// By light: index of its node × `WIDTH` + its lane, or `NONE`.
    slots: Vec<u32>,
    /// The light, if there is but one.
    single: Option<u32>,
    /// 1 over the size of the scene: distances are relative to it, so that their squares neither overflow nor vanish.
    per_scene: f32,
}

/// Eight groups, one a lane. Lengths other than centres are relative to the size of the scene; an empty lane has intensity 0.
#[derive(Clone, Debug)]
#[repr(C, align(32))]
struct Node {
    center: [[f32; WIDTH]; 3],
    axis: [[f32; WIDTH]; 3],
    radius: [f32; WIDTH],
    intensity: [f32; WIDTH],
    cos_o: [f32; WIDTH],
    sin_o: [f32; WIDTH],
    cos_e: [f32; WIDTH],
    /// −1: two-sided, 1: one-sided.
    side: [f32; WIDTH],
    /// How far the group reaches below its centre along its axis.
    depth: [f32; WIDTH],
    /// Index of a node, or of a light with `LEAF` set.
    link: [u32; WIDTH],
    /// Slot of this node in its parent, or `NONE`.
    parent: u32,
}

/// Squares of relative distances are not taken below this. Positions are known to 2⁻²⁴ of the scene's size: what is closer
/// has no meaningful direction, and the quotient stays finite.
const CLOSEST_SQUARED: f32 = 1.0 / (1u64 << 48) as f32;

impl LightTree {
    /// Bytes that it takes.
    pub fn bytes(&self) -> usize {
        size_of_val(self.nodes.as_slice()) + size_of_val(self.slots.as_slice())
    }

    /// The number of lights in it is 0.
    pub fn is_empty(&self) -> bool {
        self.single.is_none() && self.nodes.is_empty()
    }

    /// A light and the probability with which it was chosen. `None`: no light can reach the receiver.
    #[inline]
    pub fn choose(&self, from: &Receiver, u: f32) -> Option<(u32, f32)> {
        if let Some(light) = self.single {
            return Some((light, 1.0));
        }
        let mut node = self.nodes.first()?;
        let (mut u, mut pmf) = (u, 1.0);
        loop {
            let importance = node.importance(from, self.per_scene);
            let lane = choose(&importance, u)?;
            u = lane.rest;
            pmf *= lane.pmf;
            let link = node.link[lane.index];
            if link & LEAF != 0 {
                return (pmf > 0.0).then_some((link & !LEAF, pmf));
            }
            node = &self.nodes[link as usize];
        }
    }

    /// The probability with which [`Self::choose`] takes `light` for this receiver.
    #[inline]
    pub fn pmf(&self, from: &Receiver, light: u32) -> f32 {
        if self.single.is_some() {
            return if self.single == Some(light) { 1.0 } else { 0.0 };
        }
        let mut pmf = 1.0;
        let mut slot = self.slots.get(light as usize).copied().unwrap_or(NONE);
        if slot == NONE {
            return 0.0;
        }
        while slot != NONE {
            let node = &self.nodes[slot as usize / WIDTH];
            let importance = node.importance(from, self.per_scene);
            let mine = importance[slot as usize % WIDTH];
            if mine <= 0.0 {
                return 0.0;
            }
            pmf *= mine / importance.iter().sum::<f32>();
            slot = node.parent;
        }
        pmf
    }
}

impl Node {
    fn empty(parent: u32) -> Self {
        let zero = [0.0; WIDTH];
        Self {
            center: [zero; 3],
            axis: [zero; 3],
            radius: zero,
            intensity: zero,
            cos_o: [1.0; WIDTH],
            sin_o: zero,
            cos_e: zero,
            side: [1.0; WIDTH],
            depth: zero,
            link: [NONE; WIDTH],
            parent,
        }
    }

    /// Fills a lane. `scale` brings lengths and `brightness` intensities to the scene's.
    fn set(&mut self, lane: usize, bounds: &LightBounds, depth: f64, link: u32, scale: f64, brightness: f64) {
        // Below this, products with cosines and quotients by distances would leave the range of `f32`.
        const DIMMEST: f32 = 1e-20;
        let center = bounds.center();
        for axis in 0..3 {
            self.center[axis][lane] = center[axis] as f32;
            self.axis[axis][lane] = bounds.axis[axis] as f32;
        }
        self.radius[lane] = (bounds.radius() * scale) as f32;
        self.intensity[lane] = ((bounds.intensity * brightness) as f32).max(DIMMEST);
        let (sin_o, cos_o) = bounds.theta_o.sin_cos();
        self.cos_o[lane] = cos_o as f32;
        self.sin_o[lane] = sin_o.max(0.0) as f32;
        self.cos_e[lane] = bounds.theta_e.cos().max(0.0) as f32;
        self.side[lane] = if bounds.two_sided { -1.0 } else { 1.0 };
        self.depth[lane] = (depth * scale) as f32;
        self.link[lane] = link;
    }

    /// What each group may send to the receiver, up to a common factor: at least 0, and above 0 where anything arrives.
    ///
    /// **Source**: \[Conty18\] for intensity·cosθ′/d². The box counts as its bounding sphere, and everything is
    /// seen in all directions from within it.
    #[inline]
    fn importance(&self, from: &Receiver, per_scene: f32) -> [f32; WIDTH] {
        let (p, n) = (from.p, from.n);
        // Without a normal the cosine at the receiver counts as 1.
        let least_cos_i = if n == Vec3::ZERO { 1.0 } else { 0.0 };
        let mut importance = [0.0; WIDTH];
        for (i, importance) in importance.iter_mut().enumerate() {
            // From the centre to the receiver.
            let x = (p.x - self.center[0][i]) * per_scene;
            let y = (p.y - self.center[1][i]) * per_scene;
            let z = (p.z - self.center[2][i]) * per_scene;
            let radius = self.radius[i];
            let d2 = x * x + y * y + z * z;
            let per_d = 1.0 / max(d2, f32::MIN_POSITIVE).sqrt();
            let height = x * self.axis[0][i] + y * self.axis[1][i] + z * self.axis[2][i];

            // Half angle of the cone of directions to the bounding sphere.
            let sin2_b = radius * radius * per_d * per_d;
            let inside = sin2_b >= 1.0;
            let sin_b = if inside { 0.0 } else { sin2_b.sqrt() };
            let cos_b = if inside { -1.0 } else { max(1.0 - sin2_b, 0.0).sqrt() };

            // Least angle between the direction to the receiver and a normal: θ − θo − θb.
            let cos_w = height * per_d;
            let cos_w = min(max(cos_w, self.side[i] * cos_w), 1.0);
            let sin_w = max(1.0 - cos_w * cos_w, 0.0).sqrt();
            let (cos_x, sin_x) = subtract(cos_w, sin_w, self.cos_o[i], self.sin_o[i]);
            let (cos_l, _) = subtract(cos_x, sin_x, cos_b, sin_b);

            // A flat or nearly flat group does not reach what lies behind all of it, however close.
            let facing = self.cos_o[i] * (height + self.depth[i]) + self.sin_o[i] * (d2 * per_d + radius);
            let behind = (facing <= 0.0) & (self.cos_o[i] > 0.0) & (self.side[i] > 0.0);

            // Least angle at the receiver.
            let cos_i = min(max(-(x * n.x + y * n.y + z * n.z) * per_d, -1.0), 1.0);
            let sin_i = max(1.0 - cos_i * cos_i, 0.0).sqrt();
            let (cos_r, _) = subtract(cos_i, sin_i, cos_b, sin_b);

            let distance2 = max(max(d2, radius * radius), CLOSEST_SQUARED);
            let value = self.intensity[i] * cos_l * max(cos_r, least_cos_i) / distance2;
            *importance = if (cos_l > self.cos_e[i]) & !behind { value } else { 0.0 };
        }
        importance
    }
}

/// Cosine and sine of max(0, a − b).
#[inline(always)]
fn subtract(cos_a: f32, sin_a: f32, cos_b: f32, sin_b: f32) -> (f32, f32) {
    let positive = cos_a <= cos_b;
    let cos = cos_a * cos_b + sin_a * sin_b;
    let sin = sin_a * cos_b - cos_a * sin_b;
    (if positive { cos } else { 1.0 }, if positive { sin } else { 0.0 })
}

// `f32::max` and `min` mind which operand is not a number and so take several instructions; none is here.
#[inline(always)]
fn max(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

#[inline(always)]
fn min(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

#[cfg(test)]
#[path = "tree_tests.rs"]
mod tests;
