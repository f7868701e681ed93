//! Small scenes written by tests, and what is measured on them.

use std::path::PathBuf;

use renderer::filtering::Filtering;
use renderer::render::{Frame, Job};

use crate::image::RgbImage;
use crate::render::run;

/// The adaptive filter as it is by default.
///
/// # Panics
/// Never.
pub fn adaptive() -> Filtering {
    Filtering::named("adaptive").expect("the adaptive filter")
}

/// A scene file that lasts as long as this.
pub struct SceneFile {
    folder: tempfile::TempDir,
}

impl SceneFile {
    /// # Panics
    /// If there is no place for temporary files.
    pub fn new(text: &str) -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        std::fs::write(folder.path().join("scene.pbrt"), text).expect("a scene in the temporary folder");
        Self { folder }
    }

    /// Puts a file beside the scene's.
    ///
    /// # Panics
    /// If there is no room for it.
    pub fn with(self, name: &str, bytes: &[u8]) -> Self {
        std::fs::write(self.folder.path().join(name), bytes).expect("a file in the temporary folder");
        self
    }

    /// Where the file is.
    pub fn path(&self) -> PathBuf {
        self.folder.path().join("scene.pbrt")
    }

    /// Renders the scene; the job's own scene does not count.
    pub fn render(&self, job: Job) -> Frame {
        run(&Job { scene: self.path(), ..job })
    }

    /// Renders the scene with `spp` samples of `seed`, filtered or not.
    pub fn values(&self, spp: u64, seed: u64, filtering: Filtering) -> RgbImage {
        values(&self.render(Job { spp: Some(spp), seed: Some(seed), filtering, ..Job::default() }))
    }
}

/// The frame as it is shown.
pub fn values(frame: &Frame) -> RgbImage {
    let bounds = frame.film.bounds();
    let pixels = bounds.pixels().map(|at| frame.film.value(at).as_vec3().to_array()).collect();
    RgbImage { width: bounds.width() as usize, height: bounds.height() as usize, pixels }
}

/// Every bit of the frame as it is shown.
pub fn bits(frame: &Frame) -> Vec<[u32; 3]> {
    values(frame).pixels.iter().map(|pixel| pixel.map(f32::to_bits)).collect()
}

/// What stands before the world of a small scene: one sample a pixel within a box filter.
fn head(size: [u32; 2], camera: &str, depth: u32) -> String {
    format!(
        "Film \"rgb\" \"integer xresolution\" {} \"integer yresolution\" {}\n\
         PixelFilter \"box\" \"float xradius\" 0.5 \"float yradius\" 0.5\n\
         Sampler \"sobol\" \"integer pixelsamples\" 16\n\
         Integrator \"path\" \"integer maxdepth\" {depth}\n\
         {camera}\nWorldBegin\n",
        size[0], size[1]
    )
}

/// A quadrilateral of four corners in order, facing (b − a) × (c − a).
fn quad(corners: [[f32; 3]; 4]) -> String {
    let p: Vec<String> = corners.iter().flatten().map(f32::to_string).collect();
    format!("Shape \"trianglemesh\" \"point3 P\" [ {} ] \"integer indices\" [ 0 1 2 0 2 3 ]\n", p.join(" "))
}

/// A room with an open front, two blocks and a lamp below its ceiling: soft and hard shadows, corners, colour. All lengths
/// times `scale`; the lamp's radiance times `light`. The block on the right is of `material`.
pub fn room(size: [u32; 2], scale: f32, light: f32, material: &str) -> String {
    let s = |x: f32| x * scale;
    let at = |p: [f32; 3]| p.map(s);
    let wall = |corners: [[f32; 3]; 4]| quad(corners.map(at));
    let camera =
        format!("LookAt 0 {} {}  0 0 {}  0 0 1\nCamera \"perspective\" \"float fov\" 40", s(-3.75), s(1.0), s(1.0));
    let mut text = head(size, &camera, 6);
    let diffuse = |rgb: &str| format!("Material \"diffuse\" \"rgb reflectance\" [ {rgb} ]\n");
    text += &diffuse("0.7 0.7 0.7");
    text += &wall([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]]);
    text += &wall([[-1.0, -1.0, 2.0], [-1.0, 1.0, 2.0], [1.0, 1.0, 2.0], [1.0, -1.0, 2.0]]);
    text += &wall([[-1.0, 1.0, 0.0], [1.0, 1.0, 0.0], [1.0, 1.0, 2.0], [-1.0, 1.0, 2.0]]);
    text += &diffuse("0.6 0.1 0.1");
    text += &wall([[-1.0, -1.0, 0.0], [-1.0, 1.0, 0.0], [-1.0, 1.0, 2.0], [-1.0, -1.0, 2.0]]);
    text += &diffuse("0.1 0.5 0.1");
    text += &wall([[1.0, -1.0, 0.0], [1.0, -1.0, 2.0], [1.0, 1.0, 2.0], [1.0, 1.0, 0.0]]);
    let block = |centre: [f32; 2], half: f32, height: f32, degrees: f32| {
        let corners: Vec<[f32; 3]> = (0..8)
            .map(|i| {
                let (sin, cos) = degrees.to_radians().sin_cos();
                let x = if i & 1 == 0 { -half } else { half };
                let y = if i & 2 == 0 { -half } else { half };
                let z = if i & 4 == 0 { 0.0 } else { height };
                at([centre[0] + cos * x - sin * y, centre[1] + sin * x + cos * y, z])
            })
            .collect();
        let p: Vec<String> = corners.iter().flatten().map(f32::to_string).collect();
        format!(
            "Shape \"trianglemesh\" \"point3 P\" [ {} ] \"integer indices\" [ 4 5 7 4 7 6  0 1 5 0 5 4  1 3 7 1 7 5  \
             3 2 6 3 6 7  2 0 4 2 4 6 ]\n",
            p.join(" ")
        )
    };
    text += &diffuse("0.7 0.7 0.7");
    text += &block([-0.4, 0.3], 0.28, 1.2, 20.0);
    text += material;
    text += &block([0.4, -0.3], 0.28, 0.6, -17.0);
    text += &format!("AreaLightSource \"diffuse\" \"rgb L\" [ {0} {0} {0} ]\n", 12.0 * light);
    text += &wall([[-0.3, -0.3, 1.98], [-0.3, 0.3, 1.98], [0.3, 0.3, 1.98], [0.3, -0.3, 1.98]]);
    text
}

/// A block's material that is as plain as the walls'.
pub const PLAIN: &str = "Material \"diffuse\" \"rgb reflectance\" [ 0.6 0.6 0.7 ]\n";

/// A floor of GGX metal below a chequered ceiling of lamps.
pub fn chequered(size: [u32; 2], alpha: f32) -> String {
    let camera = "LookAt 0 -6 2.5  0 0 0  0 0 1\nCamera \"perspective\" \"float fov\" 40";
    let mut text = head(size, camera, 1);
    text += &format!(
        "Material \"conductor\" \"rgb reflectance\" [ 0.9 0.9 0.9 ] \"float roughness\" {alpha} \
         \"bool remaproughness\" false\n"
    );
    text += &quad([[-4.0, -4.0, 0.0], [4.0, -4.0, 0.0], [4.0, 4.0, 0.0], [-4.0, 4.0, 0.0]]);
    let (mut p, mut indices, mut count) = (String::new(), String::new(), 0);
    for i in 0..12 {
        for j in (i % 2..12).step_by(2) {
            let (x, y) = (-6.0 + i as f32, -4.0 + j as f32);
            for corner in [[x, y], [x, y + 1.0], [x + 1.0, y + 1.0], [x + 1.0, y]] {
                p += &format!("{} {} 4  ", corner[0], corner[1]);
            }
            indices += &format!("{} {} {}  {} {} {}  ", count, count + 1, count + 2, count, count + 2, count + 3);
            count += 4;
        }
    }
    text += "AreaLightSource \"diffuse\" \"rgb L\" [ 1 1 1 ]\n";
    text += &format!("Shape \"trianglemesh\" \"point3 P\" [ {p} ] \"integer indices\" [ {indices} ]\n");
    text
}

/// A dark box with a slit in its front that lets a little light in, seen through the open side; below it a slab that
/// nearly touches the floor.
pub fn cavity(size: [u32; 2]) -> String {
    let camera = "LookAt 0 -3.6 1.2  0 0.2 0.6  0 0 1\nCamera \"perspective\" \"float fov\" 42";
    let mut text = head(size, camera, 6);
    text += "Material \"diffuse\" \"rgb reflectance\" [ 0.6 0.6 0.6 ]\n";
    // Floor.
    text += &quad([[-3.0, -3.0, 0.0], [3.0, -3.0, 0.0], [3.0, 3.0, 0.0], [-3.0, 3.0, 0.0]]);
    // The box: back, sides, and a lid that leaves a slit along the back.
    text += &quad([[-1.0, 1.0, 0.0], [1.0, 1.0, 0.0], [1.0, 1.0, 1.2], [-1.0, 1.0, 1.2]]);
    text += &quad([[-1.0, -0.6, 0.0], [-1.0, 1.0, 0.0], [-1.0, 1.0, 1.2], [-1.0, -0.6, 1.2]]);
    text += &quad([[1.0, -0.6, 0.0], [1.0, -0.6, 1.2], [1.0, 1.0, 1.2], [1.0, 1.0, 0.0]]);
    text += &quad([[-1.0, -0.6, 1.2], [1.0, -0.6, 1.2], [1.0, 0.96, 1.2], [-1.0, 0.96, 1.2]]);
    // A slab on short legs that are not there.
    text += &quad([[-0.4, -0.3, 0.04], [0.4, -0.3, 0.04], [0.4, 0.3, 0.04], [-0.4, 0.3, 0.04]]);
    text += "LightSource \"infinite\" \"rgb L\" [ 0.02 0.02 0.02 ]\n";
    text += "AreaLightSource \"diffuse\" \"rgb L\" [ 40 40 40 ]\n";
    text += &quad([[-0.5, 0.5, 3.0], [-0.5, 1.5, 3.0], [0.5, 1.5, 3.0], [0.5, 0.5, 3.0]]);
    text
}

/// What fills the view: `world` after a camera at the origin that looks along y.
pub fn view(size: [u32; 2], camera: &str, world: &str) -> String {
    head(size, &format!("LookAt 0 0 0  0 1 0  0 0 1\n{camera}"), 4) + world
}

/// Mean of (image − a)(image − b) over the pixels that `counts` selects, relative to brightness: the squared error when a
/// and b are independent references. All channels.
pub fn squared_error(image: &RgbImage, a: &RgbImage, b: &RgbImage, counts: impl Fn(usize, usize) -> bool) -> f64 {
    let errors = crate::error::Errors::new(&image.pixels, a, b);
    let (mut sum, mut n) = (0.0, 0.0);
    for (i, error) in errors.pixels.iter().enumerate() {
        if counts(i % image.width, i / image.width) {
            sum += error;
            n += 1.0;
        }
    }
    sum / f64::max(n, 1.0)
}

/// Mean of several images.
pub fn average(images: &[RgbImage]) -> RgbImage {
    let mut mean = images[0].clone();
    for (i, pixel) in mean.pixels.iter_mut().enumerate() {
        let sum = |c: usize| images.iter().map(|image| f64::from(image.pixels[i][c])).sum::<f64>();
        *pixel = std::array::from_fn(|c| (sum(c) / images.len() as f64) as f32);
    }
    mean
}
