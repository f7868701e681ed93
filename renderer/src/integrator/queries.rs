//! The two questions that a path asks of the geometry.

use std::cell::RefCell;

use embree::{CommittedScene, Hit};

use crate::interaction::AlphaTest;
use crate::math::Ray;

/// Ray queries. A path loop is compiled once per implementation, so that a scene without alpha masks, say, does not pay
/// for asking whether it has some.
pub trait Queries {
    /// The closest hit of `ray`.
    fn intersect(&self, ray: &Ray) -> Option<Hit>;
    /// Whether anything lies on `ray`.
    fn occluded(&self, ray: &Ray) -> bool;
}

/// A scene in which every hit is real.
pub struct Opaque<'w>(pub &'w CommittedScene);

impl Queries for Opaque<'_> {
    #[inline]
    fn intersect(&self, ray: &Ray) -> Option<Hit> {
        self.0.intersect(&embree_ray(ray))
    }

    #[inline]
    fn occluded(&self, ray: &Ray) -> bool {
        self.0.occluded(&embree_ray(ray))
    }
}

/// A scene in which some hits must pass an alpha test.
pub struct AlphaTested<'w> {
    /// The geometry.
    pub scene: &'w CommittedScene,
    /// The test.
    pub alpha: AlphaTest<'w>,
}

impl Queries for AlphaTested<'_> {
    #[inline]
    fn intersect(&self, ray: &Ray) -> Option<Hit> {
        self.scene.intersect_filtered(&embree_ray(ray), &|hit: &Hit| self.alpha.accepts(ray, hit))
    }

    #[inline]
    fn occluded(&self, ray: &Ray) -> bool {
        self.scene.occluded_filtered(&embree_ray(ray), &|hit: &Hit| self.alpha.accepts(ray, hit))
    }
}

/// A query as it was asked.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Recorded {
    /// For the closest hit.
    Closest(Ray),
    /// For any hit.
    Any(Ray),
}

/// Passes queries on and keeps them, so that a benchmark can ask them again without shading anything.
pub struct Recording<'q, Q> {
    queries: &'q Q,
    log: RefCell<Vec<Recorded>>,
}

impl<'q, Q: Queries> Recording<'q, Q> {
    /// An empty record over `queries`.
    pub fn new(queries: &'q Q) -> Self {
        Self { queries, log: RefCell::default() }
    }

    /// What was asked, in order.
    pub fn into_log(self) -> Vec<Recorded> {
        self.log.into_inner()
    }
}

impl<Q: Queries> Queries for Recording<'_, Q> {
    fn intersect(&self, ray: &Ray) -> Option<Hit> {
        self.log.borrow_mut().push(Recorded::Closest(*ray));
        self.queries.intersect(ray)
    }

    fn occluded(&self, ray: &Ray) -> bool {
        self.log.borrow_mut().push(Recorded::Any(*ray));
        self.queries.occluded(ray)
    }
}

#[inline]
fn embree_ray(ray: &Ray) -> embree::Ray {
    // The origin is already clear of its surface (`math::spawn_ray`), so the interval starts at 0.
    embree::Ray { origin: ray.origin, direction: ray.direction, t_near: 0.0, t_far: ray.t_max }
}
