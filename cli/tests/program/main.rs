//! The program from outside: exit codes, streams, files.

mod compare;
mod denoise;
mod faults;
mod info;
mod merge;
mod preview;
mod render;
mod sequence;
mod study;
mod usage;

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// A folder of its own for a test, deleted at its end, in which the program is run.
struct Bench(tempfile::TempDir);

/// What a run of the program came to.
struct Run {
    code: i32,
    stdout: String,
    stderr: String,
}

impl Bench {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// The program, not yet run, in this folder and without the surroundings' say in its behaviour.
    fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_tessera"));
        command.args(arguments).current_dir(self.0.path());
        command.env_remove("SLURM_CPUS_PER_TASK").env_remove("SOURCE_DATE_EPOCH");
        command
    }

    fn run(&self, arguments: &[&str]) -> Run {
        Run::of(self.command(arguments).output().unwrap())
    }

    /// Runs what must succeed.
    #[track_caller]
    fn succeed(&self, arguments: &[&str]) -> Run {
        let run = self.run(arguments);
        assert_eq!(run.code, 0, "{arguments:?}: {}", run.stderr);
        run
    }

    /// Runs what must fail with `code` and a message that has all of `words`.
    #[track_caller]
    fn fail(&self, arguments: &[&str], code: i32, words: &[&str]) -> Run {
        let run = self.run(arguments);
        assert_eq!(run.code, code, "{arguments:?}: {}", run.stderr);
        for word in words {
            assert!(run.stderr.contains(word), "{arguments:?}: no {word:?} in {}", run.stderr);
        }
        run
    }

    /// The names of all files in the folder, hidden ones included, sorted.
    fn files(&self) -> Vec<String> {
        let entries = std::fs::read_dir(self.0.path()).unwrap();
        let mut names: Vec<_> = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    fn write(&self, name: &str, text: &str) {
        std::fs::write(self.path(name), text).unwrap();
    }

    /// Writes an EXR of R G B, 32 bits each.
    fn write_image(&self, name: &str, width: usize, height: usize, value: impl Fn(usize, usize) -> [f32; 3]) {
        self.write_channels(name, [width, height], &["R", "G", "B"], |x, y| value(x, y).into());
    }

    /// Writes an EXR of 32-bit channels.
    fn write_channels(
        &self,
        name: &str,
        [width, height]: [usize; 2],
        channels: &[&str],
        value: impl Fn(usize, usize) -> Vec<f32>,
    ) {
        let pixels: Vec<f32> = (0..width * height).flat_map(|at| value(at % width, at / width)).collect();
        let channel = |name: &&str| oiio::Channel { name: (*name).to_owned(), format: oiio::Format::Float };
        let window = oiio::Window::at_origin(width, height);
        oiio::write(&oiio::Output {
            path: &self.path(name),
            file_format: oiio::FileFormat::Exr,
            data_window: window,
            display_window: window,
            channels: channels.iter().map(channel).collect(),
            pixels: &pixels,
            attributes: Vec::new(),
            compression: oiio::Compression::Zip,
        })
        .unwrap();
    }
}

impl Run {
    fn of(output: Output) -> Self {
        Self {
            code: output.status.code().expect("ended by a signal"),
            stdout: String::from_utf8(output.stdout).unwrap(),
            stderr: String::from_utf8(output.stderr).unwrap(),
        }
    }

    #[track_caller]
    fn json(&self) -> serde_json::Value {
        serde_json::from_str(&self.stdout).unwrap_or_else(|why| panic!("{why}: {}", self.stdout))
    }
}

fn read(path: &Path) -> oiio::Image {
    oiio::read(path).unwrap()
}

/// A diffuse sphere on a floor under an area light and a sky.
const SCENE: &str = r#"
LookAt 0 1 5  0 1 0  0 1 0
Camera "perspective" "float fov" 40
Film "rgb" "integer xresolution" 48 "integer yresolution" 32 "string filename" "unused.exr"
Sampler "independent" "integer pixelsamples" 4
Integrator "path" "integer maxdepth" 4
WorldBegin
LightSource "infinite" "rgb L" [ 0.2 0.3 0.5 ]
AttributeBegin
  AreaLightSource "diffuse" "rgb L" [ 6 5 4 ]
  Translate 0 4 0
  Rotate 90 1 0 0
  Shape "disk" "float radius" 1
AttributeEnd
Material "diffuse" "rgb reflectance" [ 0.6 0.4 0.2 ]
Shape "bilinearmesh" "point3 P" [ -5 0 -5  5 0 -5  -5 0 5  5 0 5 ]
Translate 0 1 0
Shape "sphere" "float radius" 1
"#;
