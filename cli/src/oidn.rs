//! Intel Open Image Denoise, by its own program `oidnDenoise`: no library of it is linked, and nothing here is unsafe.

use std::ffi::OsString;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::exit::Failure;

/// The program.
pub struct Oidn {
    program: PathBuf,
}

/// What is denoised.
pub struct Pictures {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Linear RGB, row by row from the top.
    pub color: Vec<[f32; 3]>,
    /// Albedo and normals, if there are any.
    pub guides: Option<[Vec<[f32; 3]>; 2]>,
}

const PROGRAM: &str = "oidnDenoise";

impl Oidn {
    /// Finds the program: `given`, or that of the environment's OIDN_DENOISE, or the one on the PATH.
    ///
    /// # Errors
    /// There is none; the message says where to get it.
    pub fn find(given: Option<&Path>) -> Result<Self, Failure> {
        let named = given.map(Path::to_owned).or_else(|| std::env::var_os("OIDN_DENOISE").map(PathBuf::from));
        let path = std::env::var_os("PATH").unwrap_or_default();
        let found = match &named {
            Some(program) => Some(program.clone()).filter(|program| program.is_file()),
            None => std::env::split_paths(&path).map(|folder| folder.join(PROGRAM)).find(|program| program.is_file()),
        };
        let wanted = named.map_or_else(|| format!("no {PROGRAM} on the PATH"), |path| format!("no {}", path.display()));
        // A name without a folder would be looked for on the PATH when it is run.
        let absolute = |program| std::path::absolute(&program).unwrap_or(program);
        found.map(|program| Self { program: absolute(program) }).ok_or_else(|| {
            Failure::Input(format!(
                "Intel Open Image Denoise is not there: {wanted}. Its releases and the Python package pyoidn carry the program \
                 {PROGRAM}; name it with --oidn FILE or in OIDN_DENOISE"
            ))
        })
    }

    /// What denoised, for an image's metadata.
    pub fn name(&self) -> &'static str {
        "Intel Open Image Denoise"
    }

    /// The denoised picture. Guides are denoised by themselves first, so that the picture may follow them closely.
    ///
    /// # Errors
    /// The program fails, or its files cannot be written or read.
    pub fn denoise(&self, pictures: &Pictures) -> Result<Vec<[f32; 3]>, Failure> {
        let folder = tempfile::tempdir().map_err(|why| failure(&"a temporary folder", &why))?;
        let at = |name: &str| folder.path().join(name);
        let write = |name: &str, pixels: &[[f32; 3]]| {
            write_pfm(&at(name), pictures, pixels).map_err(|why| failure(&at(name).display(), &why))
        };
        write("color.pfm", &pictures.color)?;
        let mut arguments: Vec<OsString> = vec!["--hdr".into(), at("color.pfm").into()];
        if let Some([albedo, normal]) = &pictures.guides {
            for (flag, pixels) in [("--alb", albedo), ("--nrm", normal)] {
                let (noisy, clean) = (format!("{}.pfm", &flag[2..]), format!("{}-clean.pfm", &flag[2..]));
                write(&noisy, pixels)?;
                self.run(&[flag.into(), at(&noisy).into(), "-o".into(), at(&clean).into()])?;
                arguments.extend([flag.into(), at(&clean).into()]);
            }
            arguments.push("--clean_aux".into());
        }
        arguments.extend(["-o".into(), at("denoised.pfm").into()]);
        self.run(&arguments)?;
        let image = oiio::read(at("denoised.pfm")).map_err(|error| Failure::Render(error.to_string()))?;
        let fits = (image.width, image.height, image.channels.len()) == (pictures.width, pictures.height, 3);
        let pixels: Vec<[f32; 3]> = image.pixels.chunks_exact(3).map(|rgb| [rgb[0], rgb[1], rgb[2]]).collect();
        if fits { Ok(pixels) } else { Err(Failure::Render(format!("{PROGRAM} wrote a picture of another size"))) }
    }

    fn run(&self, arguments: &[OsString]) -> Result<(), Failure> {
        let mut command = Command::new(&self.program);
        command.args(arguments).args(["--device", "cpu"]);
        // Where its package keeps the library that it loads, if it is not installed system-wide.
        let library = self.program.parent().map(|folder| folder.join("../lib")).filter(|folder| folder.is_dir());
        command.envs(library.map(|folder| ("LD_LIBRARY_PATH", folder)));
        let output = command.output().map_err(|why| failure(&self.program.display(), &why))?;
        if output.status.success() {
            return Ok(());
        }
        let said = [output.stdout, output.stderr].map(|text| String::from_utf8_lossy(&text).trim().to_owned());
        let last = said.iter().flat_map(|text| text.lines()).last().unwrap_or("without a word").to_owned();
        Err(Failure::Render(format!("{} failed ({}): {last}", self.program.display(), output.status)))
    }
}

fn failure(what: &dyn std::fmt::Display, why: &io::Error) -> Failure {
    Failure::Render(format!("{what}: {why}"))
}

/// Writes a portable float map: rows from the bottom, little-endian.
fn write_pfm(path: &Path, pictures: &Pictures, pixels: &[[f32; 3]]) -> io::Result<()> {
    let mut bytes = format!("PF\n{} {}\n-1.0\n", pictures.width, pictures.height).into_bytes();
    let rows = pixels.chunks_exact(pictures.width.max(1)).rev();
    bytes.extend(rows.flatten().flatten().flat_map(|value| value.to_le_bytes()));
    fs::write(path, bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_float_map_reads_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.pfm");
        let color: Vec<[f32; 3]> = (0..6).map(|i| [i as f32, -0.5, 1e9]).collect();
        let pictures = Pictures { width: 3, height: 2, color: color.clone(), guides: None };
        write_pfm(&path, &pictures, &color).unwrap();
        let image = oiio::read(&path).unwrap();
        assert_eq!((image.width, image.height), (3, 2));
        assert_eq!(image.pixels, color.as_flattened());
    }

    #[test]
    fn an_absent_program_is_named_with_where_to_get_it() {
        let error = Oidn::find(Some(Path::new("/nonexistent/oidnDenoise"))).err().unwrap();
        assert_eq!(error.code(), 3);
        assert!(["/nonexistent/oidnDenoise", "pyoidn", "--oidn"].iter().all(|word| error.to_string().contains(word)));
    }
}
