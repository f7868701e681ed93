//! Every scene of the shared folder is read without an error.

use std::path::PathBuf;

use renderer::scene::pbrt;

/// The folder of shared scenes, where there is one: named by `TESSERA_SHARED`, or beside the workspace.
fn shared() -> Option<PathBuf> {
    let named = std::env::var_os("TESSERA_SHARED").map(PathBuf::from);
    let beside = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../shared");
    named.or(Some(beside)).map(|folder| folder.join("scenes")).filter(|folder| folder.is_dir())
}

#[test]
#[allow(clippy::print_stderr)]
fn shared_scenes_are_read_without_an_error() {
    let Some(folder) = shared() else {
        eprintln!("skipped: there is no folder of shared scenes (TESSERA_SHARED)");
        return;
    };
    let mut read = 0;
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path().join("scene-v4.pbrt");
        if !path.is_file() {
            continue;
        }
        match pbrt::load(&path) {
            Ok((scene, warnings)) => {
                for warning in warnings {
                    eprintln!("{warning}");
                }
                assert!(!scene.shapes.is_empty() || !scene.instances.is_empty(), "{} is empty", path.display());
                read += 1;
            }
            Err(all) => panic!("{}", all.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")),
        }
    }
    assert!(read > 0, "the folder of shared scenes holds none");
}
