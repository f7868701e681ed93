//! Where camera rays start: the map from a film point to a ray, the pixel filter, and which pixels are rendered.
//!
//! Film points are continuous pixel coordinates, x to the right and y down: the centre of the first pixel is
//! (0.5, 0.5). Camera space looks along +z with y up and x to the right.
//!
//! A ray carries the cone of its pixel, for texture filtering: at distance d along the unit direction its radius is
//! `radius + spread · d`, half the side of a square with the pixel's footprint.

mod equal_area;
mod filter;
mod pixels;

pub use filter::{Filter, FilterSample};
pub use pixels::rendered_pixels;

use glam::{Affine3A, DMat3, DMat4, DVec4, Mat4, Vec2, Vec3, Vec3A};

use crate::math::{Ray, octahedral, warp};
use crate::scene::Span;
use crate::scene::description::{self, CameraKind};

/// What cannot be rendered about a camera or a pixel filter, and where the scene says it.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{message}")]
pub struct CameraError {
    /// Where it was described; `None`: nowhere in particular.
    pub span: Option<Span>,
    /// What is wrong and what to do about it.
    pub message: String,
}

/// A camera ray and the cone of its pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraRay {
    /// World space; the direction is unit to rounding.
    pub ray: Ray,
    /// Growth of the cone's radius per unit of distance.
    pub spread: f32,
    /// Radius of the cone at the ray's origin, world units.
    pub radius: f32,
}

/// A map from film points to rays.
#[derive(Clone, Debug)]
pub struct Camera {
    world_from_camera: Affine3A,
    resolution: [u32; 2],
    projection: Projection,
}

/// The kinds of cameras with everything precomputed. The constant `cone` of each is √(|det M| Ω) / 2, where M is the
/// linear part of `world_from_camera` and Ω the pixel's area on the plane z = 1 (perspective), on any plane of constant
/// z (orthographic), or its solid angle in camera space (spherical).
#[derive(Clone, Debug)]
enum Projection {
    Perspective { plane: Plane, lens: Option<Lens>, cone: f32 },
    Orthographic { plane: Plane, cone: f32 },
    LatitudeLongitude { square_from_film: Vec2, cone: f32 },
    EqualArea { square_from_film: Vec2, cone: f32 },
}

/// The affine map from film points to x and y on a plane of constant z.
#[derive(Clone, Copy, Debug)]
struct Plane {
    origin: Vec2,
    scale: Vec2,
}

impl Plane {
    fn at(&self, film: Vec2) -> Vec2 {
        self.origin + self.scale * film
    }

    fn pixel_area(&self) -> f32 {
        (self.scale.x * self.scale.y).abs()
    }
}

#[derive(Clone, Copy, Debug)]
struct Lens {
    radius: f32,
    /// One over the distance in focus: an infinite distance is as good as any.
    inverse_focal_distance: f32,
}

impl Camera {
    /// Where the camera is, world space.
    pub fn position(&self) -> Vec3 {
        self.world_from_camera.translation.into()
    }

    /// The camera that a description means, for a frame of `resolution` pixels.
    ///
    /// **Errors**: parameters that yield no image, such as an angle of view of 180° or a singular transform.
    ///
    /// **Source**: pbrt-v4's cameras, by behaviour. So an orthographic camera with a lens is not orthographic: all its
    /// rays start on the lens at the camera's origin, and meet the focal plane where the parallel rays would.
    pub fn build(camera: &description::Camera, resolution: [u32; 2]) -> Result<Self, CameraError> {
        check(camera, resolution).map_err(|message| CameraError { span: Some(camera.span), message })?;
        let matrix = camera.world_from_camera.matrix();
        Ok(Self {
            world_from_camera: Affine3A::from_mat4(matrix.as_mat4()),
            resolution,
            projection: projection(camera, resolution, determinant(matrix).abs()),
        })
    }

    /// The ray through the film point `film`, from the point of the lens that `lens` in [0, 1)² chooses; a camera
    /// without a lens ignores `lens`.
    ///
    /// **Returns** `None` where the camera sees nothing. The kinds of today see everywhere, points beyond the film's
    /// edge, where the filter of an outermost pixel reaches, included.
    #[inline]
    pub fn ray(&self, film: Vec2, lens: Vec2) -> Option<CameraRay> {
        Some(match &self.projection {
            Projection::Perspective { plane, lens: None, cone } => self.central(plane.at(film), Vec2::ZERO, *cone),
            Projection::Perspective { plane, lens: Some(thin), cone } => {
                let on_lens = thin.radius * warp::concentric_disk(lens);
                self.central(plane.at(film) - on_lens * thin.inverse_focal_distance, on_lens, *cone)
            }
            Projection::Orthographic { plane, cone } => {
                let direction = self.world_from_camera.transform_vector3(Vec3::Z);
                let length = direction.length();
                CameraRay {
                    ray: Ray::new(
                        self.world_from_camera.transform_point3(plane.at(film).extend(0.0)),
                        direction / length,
                    ),
                    spread: 0.0,
                    radius: cone / length.sqrt(),
                }
            }
            Projection::LatitudeLongitude { square_from_film, cone } => {
                let angles = film * *square_from_film * Vec2::new(std::f32::consts::TAU, std::f32::consts::PI);
                let (sin_phi, cos_phi) = angles.x.sin_cos();
                let (sin_theta, cos_theta) = angles.y.sin_cos();
                // The solid angle of a row of pixels shrinks towards the poles with sinθ.
                let cone = cone * sin_theta.abs().sqrt();
                self.along(Vec3::new(sin_theta * cos_phi, cos_theta, sin_theta * sin_phi), Vec2::ZERO, cone)
            }
            Projection::EqualArea { square_from_film, cone } => {
                let d = octahedral::direction_from_square(equal_area::wrap(film * *square_from_film));
                self.along(Vec3::new(d.x, d.z, d.y), Vec2::ZERO, *cone)
            }
        })
    }

    /// The frame as the unit square, y down, from world space, for metadata: w is the depth along the camera's axis if
    /// the camera is in perspective, z / w grows from 0 at a distance of 0.01 to 1 at infinity (orthographic: z is the
    /// depth). The centre of the lens stands for all of it. `None`: no matrix does what this camera does.
    pub fn ndc_from_world(&self) -> Option<DMat4> {
        let (plane, perspective) = match &self.projection {
            Projection::Perspective { plane, .. } => (plane, true),
            Projection::Orthographic { plane, .. } => (plane, false),
            Projection::LatitudeLongitude { .. } | Projection::EqualArea { .. } => return None,
        };
        let size = glam::DVec2::new(f64::from(self.resolution[0]), f64::from(self.resolution[1]));
        let scale = 1.0 / (plane.scale.as_dvec2() * size);
        let offset = -plane.origin.as_dvec2() * scale;
        let (x, y) = (DVec4::X * scale.x, DVec4::Y * scale.y);
        let ndc_from_camera = if perspective {
            DMat4::from_cols(x, y, offset.extend(1.0).extend(1.0), DVec4::new(0.0, 0.0, -0.01, 0.0))
        } else {
            DMat4::from_cols(x, y, DVec4::Z, offset.extend(0.0).extend(1.0))
        };
        let world_from_camera = glam::DAffine3::from_mat4(Mat4::from(self.world_from_camera).as_dmat4());
        Some(ndc_from_camera * DMat4::from(world_from_camera.inverse()))
    }

    /// The ray from (`start`, 0) along (`slope`, 1), both in camera space.
    #[inline]
    fn central(&self, slope: Vec2, start: Vec2, cone: f32) -> CameraRay {
        self.along(slope.extend(1.0), start, cone)
    }

    /// The ray from (`start`, 0) along `q`. A linear map M takes the solid angle dω around the unit vector ω to
    /// |det M| dω / |Mω|³, and a plane's area dA at z = 1 subtends dA / |q|³ from the origin: so here, with Ω as in
    /// [`Projection`], the pixel subtends |det M| Ω / |Mq|³ in the world.
    #[inline]
    fn along(&self, q: Vec3, start: Vec2, cone: f32) -> CameraRay {
        let direction = self.world_from_camera.matrix3 * Vec3A::from(q);
        let length = direction.length();
        let origin = self.world_from_camera.transform_point3(start.extend(0.0));
        CameraRay {
            ray: Ray::new(origin, (direction / length).into()),
            spread: cone / (length * length.sqrt()),
            radius: 0.0,
        }
    }
}

fn projection(camera: &description::Camera, resolution: [u32; 2], determinant: f64) -> Projection {
    let size = Vec2::new(resolution[0] as f32, resolution[1] as f32);
    let cone = |pixel: f32| 0.5 * (determinant as f32 * pixel).sqrt();
    let lens = (camera.lens_radius > 0.0)
        .then(|| Lens { radius: camera.lens_radius, inverse_focal_distance: camera.focal_distance.recip() });
    match camera.kind {
        CameraKind::Perspective { fov } => {
            let plane = plane(camera, size, (0.5 * f64::from(fov).to_radians()).tan());
            Projection::Perspective { plane, lens, cone: cone(plane.pixel_area()) }
        }
        CameraKind::Orthographic => match lens {
            None => {
                let plane = plane(camera, size, 1.0);
                Projection::Orthographic { plane, cone: cone(plane.pixel_area()) }
            }
            Some(_) => {
                let plane = plane(camera, size, 1.0 / f64::from(camera.focal_distance));
                Projection::Perspective { plane, lens, cone: cone(plane.pixel_area()) }
            }
        },
        CameraKind::Spherical { equal_area } => {
            let square_from_film = size.recip();
            let pixel = square_from_film.x * square_from_film.y;
            if equal_area {
                Projection::EqualArea { square_from_film, cone: cone(4.0 * std::f32::consts::PI * pixel) }
            } else {
                let cone = cone(2.0 * std::f32::consts::PI * std::f32::consts::PI * pixel);
                Projection::LatitudeLongitude { square_from_film, cone }
            }
        }
    }
}

/// The screen window scaled by `scale`, as a map from film points. The shorter side of the default window is [-1, 1].
fn plane(camera: &description::Camera, size: Vec2, scale: f64) -> Plane {
    let aspect = camera.frame_aspect_ratio.unwrap_or(size.x / size.y);
    let [x0, x1, y0, y1] = camera.screen_window.unwrap_or(if aspect > 1.0 {
        [-aspect, aspect, -1.0, 1.0]
    } else {
        [-1.0, 1.0, -1.0 / aspect, 1.0 / aspect]
    });
    let scaled = |value: f32| (f64::from(value) * scale) as f32;
    Plane {
        origin: Vec2::new(scaled(x0), scaled(y1)),
        scale: Vec2::new(scaled(x1 - x0) / size.x, scaled(y0 - y1) / size.y),
    }
}

fn determinant(m: DMat4) -> f64 {
    DMat3::from_mat4(m).determinant()
}

fn check(camera: &description::Camera, resolution: [u32; 2]) -> Result<(), String> {
    let matrix = camera.world_from_camera.matrix();
    let aspect = camera.frame_aspect_ratio.unwrap_or(1.0);
    let [x0, x1, y0, y1] = camera.screen_window.unwrap_or([-1.0, 1.0, -1.0, 1.0]);
    let fov = if let CameraKind::Perspective { fov } = camera.kind { fov } else { 90.0 };
    let (lens, focus) = (camera.lens_radius, camera.focal_distance);
    let rules = [
        (!resolution.contains(&0), format!("a frame of {} x {} pixels shows nothing", resolution[0], resolution[1])),
        (
            camera.world_from_camera.is_invertible() && determinant(matrix) as f32 != 0.0,
            "the camera's transform is singular: see the directives before Camera".into(),
        ),
        (matrix.row(3) == DVec4::W, "the camera's transform is projective: only affine ones are understood".into()),
        (fov > 0.0 && fov < 180.0, format!("\"fov\" is {fov}, but must lie between 0 and 180 degrees")),
        (aspect > 0.0 && aspect.is_finite(), format!("\"frameaspectratio\" is {aspect}, but must be above 0")),
        (
            [x1 - x0, y1 - y0].iter().all(|side| *side != 0.0 && side.is_finite()),
            format!("\"screenwindow\" [{x0} {x1} {y0} {y1}] has no area"),
        ),
        (lens >= 0.0 && lens.is_finite(), format!("\"lensradius\" is {lens}, but must be 0 or more")),
        (lens <= 0.0 || focus > 0.0, format!("\"focaldistance\" is {focus}, but must be above 0")),
    ];
    rules.into_iter().find(|(holds, _)| !holds).map_or(Ok(()), |(_, message)| Err(message))
}

#[cfg(test)]
mod tests;
