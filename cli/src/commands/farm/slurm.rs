//! Batch scripts for Slurm.

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{self, Path};

use super::{NOTICE_SECONDS, Place, Sequence, Task, plain, quoted};
use crate::args::SlurmArguments;
use crate::exit::Failure;
use crate::log::Log;
use crate::output::OutputFile;

/// Writes the scripts.
///
/// # Errors
/// As [`Sequence::new`]; the folder cannot be written.
pub fn write(arguments: &SlurmArguments, log: &Log) -> Result<(), Failure> {
    let folder = absolute(&arguments.folder)?;
    let failure = |why| Failure::Output(format!("cannot make the folder \"{}\": {why}", folder.display()));
    let sequence = Sequence::new(&arguments.sequence, log)?;
    let scripts = Scripts::of(&sequence, &folder, arguments.retries)?;
    fs::create_dir_all(&folder).map_err(failure)?;
    for (name, text) in [("render.sbatch", scripts.render), ("merge.sbatch", scripts.merge), ("submit", scripts.submit)]
    {
        OutputFile::prepare(&folder.join(name))?.write(text.as_bytes())?;
    }
    fs::set_permissions(folder.join("submit"), fs::Permissions::from_mode(0o755)).map_err(failure)?;
    log.info(&format!(
        "wrote {0}/render.sbatch, merge.sbatch and submit; run {0}/submit, with options for sbatch as you like",
        folder.display()
    ));
    Ok(())
}

/// What is written.
struct Scripts {
    render: String,
    merge: String,
    submit: String,
}

impl Scripts {
    /// Every path is absolute: Slurm runs copies of the scripts, elsewhere.
    fn of(sequence: &Sequence<'_>, folder: &Path, retries: u32) -> Result<Self, Failure> {
        let scene = absolute(&sequence.arguments.scene)?;
        let output = absolute(&sequence.arguments.output)?;
        let (scene, output, folder) = (plain(&scene)?, plain(&output)?, plain(folder)?);
        let images = Place::of(Path::new(output))?.folder;
        let program = program(sequence)?;
        Ok(Self {
            render: render(sequence, &program, scene, folder),
            merge: merge(sequence, &program, output, folder),
            submit: submit(sequence, images, folder, retries),
        })
    }
}

/// Where the program is: machines of a cluster share the folder that it is run from more often than a PATH.
fn program(sequence: &Sequence<'_>) -> Result<String, Failure> {
    if let Some(program) = &sequence.arguments.program {
        return Ok(program.clone());
    }
    let here = std::env::current_exe().map_err(|why| {
        Failure::Usage(format!("the system does not say where this program is ({why}): give --program"))
    })?;
    Ok(plain(&here)?.to_owned())
}

/// How often a task may be put back into the queue: beyond any night's preemptions, but not for ever.
const MOST_RESTARTS: u32 = 50;

/// One slice of one frame. The program takes the place of the shell, so that it is it whom Slurm's signals reach.
fn render(sequence: &Sequence<'_>, program: &str, scene: &str, folder: &str) -> String {
    let task = Task {
        scene: "\"$scene\"",
        parts: "\"$parts\"",
        frames: "\"$1\"",
        slice: "\"$SLURM_ARRAY_TASK_ID\"",
        progress: "alf",
    };
    let mut words = sequence.render(&task);
    words.extend(sequence.arguments.options.iter().map(|option| quoted(option)));
    format!(
        "\
#!/bin/bash
#SBATCH --job-name={name}
#SBATCH --output=logs/%x.%A_%a.log
#SBATCH --open-mode=append
#SBATCH --requeue
#SBATCH --signal=B:TERM@{NOTICE_SECONDS}
{cpus}# One slice of frame $1; the array's index is the slice. A task that is told to stop stores what it has and exits with 75,
# upon which a cluster with RequeueExit=75 in its slurm.conf runs it again; it then goes on where it was. Who is told to stop
# so often gets nowhere.
set -eu
if [ \"${{SLURM_RESTART_COUNT:-0}}\" -gt {MOST_RESTARTS} ]; then
    echo \"put back into the queue {MOST_RESTARTS} times: given up\" >&2
    exit 1
fi
scene={scene}
parts={parts}
exec {program} {words}
",
        name = sequence.name,
        cpus = cpus(sequence),
        scene = quoted(scene),
        parts = quoted(&format!("{folder}/parts")),
        program = quoted(program),
        words = words.join(" "),
    )
}

/// All slices of one frame to its image.
fn merge(sequence: &Sequence<'_>, program: &str, output: &str, folder: &str) -> String {
    let words = sequence.merge("\"$parts\"", "\"$1\"", "\"$output\"");
    format!(
        "\
#!/bin/bash
#SBATCH --job-name={name}-merge
#SBATCH --output=logs/%x.%j.log
#SBATCH --open-mode=append
#SBATCH --requeue
{cpus}# The slices of frame $1 become its image.
set -eu
output={output}
parts={parts}
exec {program} {words}
",
        name = sequence.name,
        cpus = cpus(sequence),
        output = quoted(output),
        parts = quoted(&format!("{folder}/parts")),
        program = quoted(program),
        words = words.join(" "),
    )
}

/// Hands all frames to Slurm. A frame is a job of its own, so that one that fails keeps no other from its merge.
///
/// Each try waits for the failure of all tries before it, not of the last one alone: one that Slurm drops, because there was
/// nothing to try again, counts as failed too.
fn submit(sequence: &Sequence<'_>, images: &str, folder: &str, retries: u32) -> String {
    let frames: Vec<_> = sequence.arguments.frames.numbers().iter().map(i32::to_string).collect();
    format!(
        "\
#!/bin/bash
# Hands the frames to Slurm: each an array of slices, the same array again, up to {retries} times, while slices fail, and a merge
# that waits for a try without failures. What is done is skipped and what was begun is gone on with, so a try costs what the
# ones before it lost; what there is no need to try, Slurm drops. Arguments are given to sbatch. Run again, it renders only
# what is missing; FRAMES=\"3 7\" names frames other than all, RETRIES=N tries more often or less.
set -euo pipefail
folder={folder}
mkdir -p -- \"$folder/logs\" \"$folder/parts\" {images}
hand_over() {{
    local job
    job=$(sbatch --parsable --chdir=\"$folder\" --kill-on-invalid-dep=yes \"$@\")
    echo \"${{job%%;*}}\"
}}
for frame in ${{FRAMES:-{frames}}}; do
    tries=$(hand_over --array=0-{last} \"$@\" -- \"$folder/render.sbatch\" \"$frame\")
    failed=afternotok:$tries done=afterok:$tries
    for ((retry = 0; retry < ${{RETRIES:-{retries}}}; retry++)); do
        again=$(hand_over --array=0-{last} --dependency=\"$failed\" \"$@\" -- \"$folder/render.sbatch\" \"$frame\")
        tries+=\" $again\" failed+=,afternotok:$again done+=?afterok:$again
    done
    merge=$(hand_over --dependency=\"$done\" \"$@\" -- \"$folder/merge.sbatch\" \"$frame\")
    echo \"frame $frame: slices are job ${{tries/ /, and while some fail }}; the merge is job $merge\"
done
",
        folder = quoted(folder),
        images = quoted(images),
        frames = frames.join(" "),
        last = sequence.arguments.slices - 1,
    )
}

/// The line that asks for processors, if any were asked for.
fn cpus(sequence: &Sequence<'_>) -> String {
    sequence.arguments.cpus.map_or(String::new(), |cpus| format!("#SBATCH --cpus-per-task={cpus}\n"))
}

fn absolute(path: &Path) -> Result<path::PathBuf, Failure> {
    path::absolute(path).map_err(|why| Failure::Usage(format!("\"{}\": {why}", path.display())))
}

#[cfg(test)]
mod tests {
    use std::process::Command;

    use super::*;
    use crate::args::FarmEngine;
    use crate::commands::farm::tests::{QUIET, parsed};

    fn scripts(words: &[&str], folder: &Path) -> Scripts {
        let FarmEngine::Slurm(arguments) = parsed(words).engine else { panic!("not slurm") };
        let sequence = Sequence::new(&arguments.sequence, &QUIET()).ok().unwrap();
        Scripts::of(&sequence, folder, arguments.retries).ok().unwrap()
    }

    const LINE: [&str; 10] =
        ["slurm", "/s/shot.####.pbrt", "-o", "/o/shot.####.exr", "--frames", "-1-2", "--slices", "3", "--folder", "/f"];

    #[test]
    fn a_task_is_requeued_told_in_time_and_gets_its_processors() {
        let scripts = scripts(
            &[&LINE[..], &["--cpus", "4", "--program", "/bin/tessera", "--", "--spp", "64"]].concat(),
            Path::new("/f"),
        );
        for line in [
            "#SBATCH --requeue\n",
            "#SBATCH --signal=B:TERM@90\n",
            "#SBATCH --cpus-per-task=4\n",
            "\nexec /bin/tessera render \"$scene\" -o \"$parts\"/shot.####.s\"$SLURM_ARRAY_TASK_ID\"of3.part --frames \"$1\" ",
            " --progress alf --spp 64\n",
        ] {
            assert!(scripts.render.contains(line), "{line}: {}", scripts.render);
        }
        assert!(!scripts.render.contains("--threads"), "the program asks SLURM_CPUS_PER_TASK itself");
        assert!(scripts.submit.contains("${FRAMES:--1 0 1 2}") && scripts.submit.contains("--array=0-2"));
    }

    #[test]
    fn directives_stand_before_the_first_command() {
        let scripts = scripts(&LINE, Path::new("/f"));
        for script in [scripts.render, scripts.merge] {
            let other = |line: &&str| !line.starts_with('#');
            let first = script.lines().position(|line| other(&line)).unwrap();
            assert!(script.lines().skip(first).all(|line| !line.starts_with("#SBATCH")), "{script}");
        }
    }

    /// A shell that runs the scripts, with a program that prints its arguments, sees the paths as they were.
    #[test]
    fn a_shell_reads_the_paths_as_they_are() {
        let folder = tempfile::tempdir().unwrap();
        let odd = folder.path().join("it's \"$HOME\" `x` \\ #");
        fs::create_dir(&odd).unwrap();
        let (scene, output) = (odd.join("a b.####.pbrt"), odd.join("c d.####.exr"));
        let program = odd.join("print it");
        fs::write(&program, "#!/bin/sh\nprintf '%s\\n' \"$@\"\n").unwrap();
        fs::set_permissions(&program, fs::Permissions::from_mode(0o755)).unwrap();
        let text = |path: &Path| path.to_str().unwrap().to_owned();
        let (scene, output, program, job) = (text(&scene), text(&output), text(&program), text(&odd));
        let scripts = scripts(
            &[
                "slurm",
                &scene,
                "-o",
                &output,
                "--frames",
                "7",
                "--slices",
                "2",
                "--folder",
                &job,
                "--program",
                &program,
            ],
            &odd,
        );
        let run = |script: &str| {
            let path = folder.path().join("script");
            fs::write(&path, script).unwrap();
            let output = Command::new("bash").arg(&path).arg("7").env("SLURM_ARRAY_TASK_ID", "1").output().unwrap();
            assert!(output.status.success(), "{output:?}");
            String::from_utf8(output.stdout).unwrap().lines().map(str::to_owned).collect::<Vec<_>>()
        };
        let rendered = run(&scripts.render);
        let restarted = |count: &str| {
            let path = folder.path().join("script");
            fs::write(&path, &scripts.render).unwrap();
            let mut bash = Command::new("bash");
            bash.arg(&path).arg("7").env("SLURM_ARRAY_TASK_ID", "1").env("SLURM_RESTART_COUNT", count);
            bash.output().unwrap().status.code()
        };
        assert_eq!(["1", "50", "51"].map(restarted), [Some(0), Some(0), Some(1)]);
        let part = format!("{job}/parts/c_d.####.s1of2.part");
        assert_eq!(rendered[..8], ["render", &scene, "-o", &part, "--frames", "7", "--slice", "1/2"]);
        let merged = run(&scripts.merge);
        let first = format!("{job}/parts/c_d.####.s0of2.part");
        assert_eq!(merged, ["merge", "--frames", "7", "-o", &output, &first, &part]);
    }

    #[test]
    fn the_submission_waits_for_all_slices_of_a_frame() {
        let folder = tempfile::tempdir().unwrap();
        let bin = folder.path().join("bin");
        fs::create_dir(&bin).unwrap();
        let sbatch = "#!/bin/sh\nprintf '<%s>' \"$@\" >> \"$0.calls\"\necho >> \"$0.calls\"\n\
                      echo \"$((40 + $(wc -l < \"$0.calls\")));cluster\"\n";
        fs::write(bin.join("sbatch"), sbatch).unwrap();
        fs::set_permissions(bin.join("sbatch"), fs::Permissions::from_mode(0o755)).unwrap();
        let job = folder.path().join("the job");
        let (job, output) = (job.to_str().unwrap(), folder.path().join("x y/####.exr"));
        let output_name = output.to_str().unwrap();
        let words = ["slurm", "/s.pbrt", "-o", output_name, "--frames", "5", "--slices", "2", "--folder", job];
        let words = [&words[..], &["--retries", "2"]].concat();
        let script = folder.path().join("submit");
        fs::write(&script, scripts(&words, Path::new(job)).submit).unwrap();
        let path = format!("{}:{}", bin.display(), std::env::var("PATH").unwrap());
        let ran = Command::new("bash").arg(&script).arg("--time=1").env("PATH", path).output().unwrap();
        assert_eq!(
            String::from_utf8(ran.stdout).unwrap(),
            "frame 5: slices are job 41, and while some fail 42 43; the merge is job 44\n"
        );
        let always = format!("<--parsable><--chdir={job}><--kill-on-invalid-dep=yes>");
        assert_eq!(
            fs::read_to_string(bin.join("sbatch.calls")).unwrap(),
            format!(
                "{always}<--array=0-1><--time=1><--><{job}/render.sbatch><5>\n\
                 {always}<--array=0-1><--dependency=afternotok:41><--time=1><--><{job}/render.sbatch><5>\n\
                 {always}<--array=0-1><--dependency=afternotok:41,afternotok:42><--time=1><--><{job}/render.sbatch><5>\n\
                 {always}<--dependency=afterok:41?afterok:42?afterok:43><--time=1><--><{job}/merge.sbatch><5>\n"
            )
        );
        assert!(output.parent().unwrap().is_dir() && Path::new(job).join("logs").is_dir());
    }
}
