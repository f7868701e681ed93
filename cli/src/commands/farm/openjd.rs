//! Job templates of Open Job Description.
//!
//! **Source**: \[OpenJD23\], "Template Schemas", and extension TASK_CHUNKING.

use std::path::{Component, Path};

use super::{NOTICE_SECONDS, Place, Sequence, Task, plain, quoted};
use crate::args::OpenjdArguments;
use crate::exit::Failure;
use crate::log::Log;

/// The template, as YAML. Names and paths are values of its parameters, so that what they contain is no part of the
/// template's own language, and engines can map paths to those of another machine.
///
/// # Errors
/// As [`Sequence::new`].
pub fn template(arguments: &OpenjdArguments, log: &Log) -> Result<String, Failure> {
    let sequence = Sequence::new(&arguments.sequence, log)?;
    for option in &arguments.sequence.options {
        if option.contains("{{") || option.contains(char::is_control) {
            return Err(Failure::Usage(format!(
                "the option \"{option}\" cannot be told from the template's own language"
            )));
        }
    }
    if arguments.sequence.program.is_none() && !on_path(PROGRAM) {
        log.warning(&format!(
            "no \"{PROGRAM}\" is on the PATH here: where there is none on the workers' either, say where it is by --program or the \
             job's parameter Program"
        ));
    }
    let parameters = Parameters::of(&sequence, plain(&arguments.parts)?);
    let text = [
        head(&sequence, &parameters, arguments.chunk > 1),
        parameters.yaml,
        FOLDERS.to_owned(),
        "steps:\n".to_owned(),
        render(&sequence, arguments.chunk),
        merge(&sequence, arguments.chunk),
    ];
    Ok(text.concat())
}

/// What workers call this program unless told.
const PROGRAM: &str = "tessera";

/// Whether a program of this name can be started here without a path.
fn on_path(program: &str) -> bool {
    let folders = std::env::var_os("PATH").unwrap_or_default();
    std::env::split_paths(&folders).any(|folder| folder.join(program).is_file())
}

/// Every session begins with making the folders, which need not exist where paths are mapped to.
const FOLDERS: &str = "\
jobEnvironments:
  - name: Folders
    script:
      actions:
        onEnter:
          command: mkdir
          args: [\"-p\", \"--\", \"{{Param.OutputFolder}}\", \"{{Param.PartsFolder}}\"]
";

fn head(sequence: &Sequence<'_>, parameters: &Parameters, chunks: bool) -> String {
    let mut text = String::new();
    if !parameters.open.is_empty() {
        text += "# Paths that are not below this file's folder are not allowed as defaults. They are to be given:\n";
        for (name, path) in &parameters.open {
            text += &format!("#   --job-param {}\n", quoted(&format!("{name}={path}")));
        }
    }
    text += "specificationVersion: jobtemplate-2023-09\n";
    if chunks {
        text += "extensions: [TASK_CHUNKING]\n";
    }
    text + &format!("name: {}\n", yaml(&sequence.name))
}

/// The definitions of the job's parameters.
struct Parameters {
    yaml: String,
    /// Parameters without a default, and what they should be.
    open: Vec<(&'static str, String)>,
}

impl Parameters {
    fn of(sequence: &Sequence<'_>, parts: &str) -> Self {
        let mut parameters = Self { yaml: "parameterDefinitions:\n".to_owned(), open: Vec::new() };
        let Place { folder, file } = sequence.scene;
        parameters.folder("SceneFolder", "Where the scene is, and what it includes.", "IN", folder);
        parameters.string("SceneFile", "The scene; #### becomes the frame number.", file);
        let Place { folder, file } = sequence.output;
        parameters.folder("OutputFolder", "Where the images go.", "OUT", folder);
        parameters.string("OutputFile", "The image; #### becomes the frame number.", file);
        parameters.folder("PartsFolder", "Slices on their way to the merge, and checkpoints.", "INOUT", parts);
        parameters.string("Frames", "Frames to render.", &sequence.arguments.frames.ascending());
        let program = sequence.arguments.program.as_deref().unwrap_or(PROGRAM);
        parameters.string("Program", "The renderer, as workers find it.", program);
        parameters
    }

    /// A folder that is mapped. The specification allows no default that is absolute or leaves the template's folder.
    fn folder(&mut self, name: &'static str, description: &str, flow: &str, path: &str) {
        self.define(name, "PATH", description);
        self.yaml += &format!("    objectType: DIRECTORY\n    dataFlow: {flow}\n");
        let below = |part| matches!(part, Component::Normal(_) | Component::CurDir);
        if Path::new(path).components().all(below) {
            self.yaml += &format!("    default: {}\n", yaml(path));
        } else {
            self.open.push((name, path.to_owned()));
        }
    }

    fn string(&mut self, name: &str, description: &str, default: &str) {
        self.define(name, "STRING", description);
        self.yaml += &format!("    default: {}\n", yaml(default));
    }

    fn define(&mut self, name: &str, kind: &str, description: &str) {
        self.yaml += &format!("  - name: {name}\n    description: {}\n    type: {kind}\n", yaml(description));
    }
}

fn render(sequence: &Sequence<'_>, chunk: u32) -> String {
    let task = Task {
        scene: "{{Param.SceneFolder}}/{{Param.SceneFile}}",
        parts: "{{Param.PartsFolder}}",
        frames: "{{Task.Param.Frame}}",
        slice: "{{Task.Param.Slice}}",
        progress: "openjd",
    };
    let map = ["--path-map", "{{Session.PathMappingRulesFile}}"].map(str::to_owned);
    let words = [sequence.render(&task), map.into(), sequence.arguments.options.clone()].concat();
    let slices = format!(
        "        - name: Slice
          type: INT
          range: \"0-{}\"
      combination: \"Frame * Slice\"
",
        sequence.arguments.slices - 1
    );
    step("Render", "", &(frames(chunk) + &slices), sequence, &words)
}

fn merge(sequence: &Sequence<'_>, chunk: u32) -> String {
    let output = "{{Param.OutputFolder}}/{{Param.OutputFile}}";
    let words = sequence.merge("{{Param.PartsFolder}}", "{{Task.Param.Frame}}", output);
    step("Merge", "    dependencies:\n      - dependsOn: Render\n", &frames(chunk), sequence, &words)
}

/// The frames of a step. A chunk may be any list of them, which `--frames` takes as it is.
fn frames(chunk: u32) -> String {
    let (kind, chunks) = match chunk {
        1 => ("INT", String::new()),
        _ => (
            "CHUNK[INT]",
            format!("          chunks: {{ defaultTaskCount: {chunk}, rangeConstraint: NONCONTIGUOUS }}\n"),
        ),
    };
    format!(
        "        - name: Frame
          type: {kind}
          range: \"{{{{Param.Frames}}}}\"
{chunks}"
    )
}

fn step(name: &str, dependencies: &str, space: &str, sequence: &Sequence<'_>, words: &[String]) -> String {
    let host = sequence.arguments.cpus.map_or(String::new(), |cpus| {
        format!("    hostRequirements:\n      amounts:\n        - name: amount.worker.vcpu\n          min: {cpus}\n")
    });
    let words: String = words.iter().map(|word| format!("            - {}\n", yaml(word))).collect();
    format!(
        "  - name: {name}
{dependencies}{host}    parameterSpace:
      taskParameterDefinitions:
{space}    script:
      actions:
        onRun:
          command: \"{{{{Param.Program}}}}\"
          args:
{words}          cancelation:
            mode: NOTIFY_THEN_TERMINATE
            notifyPeriodInSeconds: {NOTICE_SECONDS}
"
    )
}

/// A YAML scalar that is read as `text`: every JSON string is one.
fn yaml(text: &str) -> String {
    serde_json::Value::from(text).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::args::FarmEngine;
    use crate::commands::farm::tests::{QUIET, parsed};

    fn printed(words: &[&str]) -> Result<String, Failure> {
        let words = [&["openjd"], words].concat();
        let FarmEngine::Openjd(arguments) = parsed(&words).engine else { panic!("not openjd") };
        template(&arguments, &QUIET())
    }

    #[test]
    fn a_template_has_frames_times_slices_and_a_merge_of_each_frame() {
        let words =
            ["shots/a.####.pbrt", "-o", "out/a.####.exr", "--frames", "10,1-3", "--slices", "2", "--", "--spp", "64"];
        let text = printed(&words).unwrap();
        for lines in [
            "specificationVersion: jobtemplate-2023-09\nname: \"a\"\n",
            "  - name: Frames\n    description: \"Frames to render.\"\n    type: STRING\n    default: \"1-3,10\"\n",
            "          type: INT\n          range: \"{{Param.Frames}}\"\n        - name: Slice\n          type: INT\n          \
             range: \"0-1\"\n      combination: \"Frame * Slice\"\n",
            "  - name: Merge\n    dependencies:\n      - dependsOn: Render\n",
            "            - \"{{Task.Param.Slice}}/2\"\n",
            "            - \"{{Param.PartsFolder}}/a.####.s{{Task.Param.Slice}}of2.part\"\n",
            "            - \"{{Param.PartsFolder}}/a.####.s1of2.part\"\n",
            "            - \"openjd\"\n            - \"--path-map\"\n            - \"{{Session.PathMappingRulesFile}}\"\n",
            "            - \"--spp\"\n            - \"64\"\n",
            "            mode: NOTIFY_THEN_TERMINATE\n            notifyPeriodInSeconds: 90\n",
        ] {
            assert!(text.contains(lines), "{lines}\nis not in\n{text}");
        }
        assert!(!text.contains("CHUNK") && !text.contains("hostRequirements"), "{text}");
    }

    #[test]
    fn chunks_are_asked_for_by_name() {
        let text = printed(&["a.pbrt", "-o", "a.####.exr", "--frames", "1-9", "--chunk", "4", "--cpus", "8"]).unwrap();
        let chunks =
            "type: CHUNK[INT]\n          range: \"{{Param.Frames}}\"\n          chunks: { defaultTaskCount: 4, ";
        assert_eq!(text.matches(chunks).count(), 2, "{text}");
        assert!(text.contains("extensions: [TASK_CHUNKING]\n") && text.contains("vcpu\n          min: 8\n"), "{text}");
    }

    #[test]
    fn paths_are_values_and_never_language() {
        let text = printed(&["it's \"{{x}}\": #/a b.pbrt", "-o", "/out/a.####.exr", "--frames", "1"]).unwrap();
        assert!(text.contains(r#"    default: "it's \"{{x}}\": #""#), "{text}");
        assert!(text.starts_with("# ") && text.contains("\n#   --job-param OutputFolder=/out\n"), "{text}");
        assert!(!text.contains("default: \"/out"), "{text}");
        let refused = printed(&["a.pbrt", "-o", "a.exr", "--frames", "1", "--", "--camera", "{{x}}"]);
        assert!(refused.is_err());
    }
}
