//! Where the files of a scene are on this machine.

use std::path::Path;

use clap::Args;
use renderer::scene::{PathFormat, PathMap, PathRule};
use serde::Deserialize;

/// Where files are.
#[derive(Clone, Debug, Default, Args)]
#[command(next_help_heading = "Run")]
pub struct PathArguments {
    /// Files that the scene has below FROM are below TO on this machine. Or a file of such rules, *.json, as Open Job
    /// Description hands them to its tasks
    #[arg(long, value_name = "FROM=TO", value_parser = rules)]
    path_map: Vec<Rules>,
}

/// The rules of one option.
type Rules = std::sync::Arc<[PathRule]>;

impl PathArguments {
    /// All rules.
    pub fn map(&self) -> PathMap {
        self.path_map.iter().flat_map(|rules| rules.iter().cloned()).collect()
    }
}

/// **Source**: \[OpenJD23\], "Path Mapping", schema pathmapping-1.0. Sessions without rules write an empty object.
#[derive(Deserialize)]
struct File {
    version: Option<String>,
    #[serde(default)]
    path_mapping_rules: Vec<Rule>,
}

#[derive(Deserialize)]
struct Rule {
    source_path_format: String,
    source_path: String,
    destination_path: String,
}

fn rules(text: &str) -> Result<Rules, String> {
    if let Some((from, to)) = text.split_once('=').filter(|(from, to)| !from.is_empty() && !to.is_empty()) {
        // What begins with a drive or has a backslash is no path of this system.
        let windows = from.contains('\\') || from.as_bytes().get(1) == Some(&b':');
        let format = if windows { PathFormat::Windows } else { PathFormat::Posix };
        return Ok([PathRule { format, from: from.into(), to: to.into() }].into());
    }
    let path = Path::new(text);
    if path.extension().is_none_or(|extension| extension != "json") {
        return Err("expected FROM=TO, such as /jobs=/mnt/jobs, or the name of a .json file".into());
    }
    let json = std::fs::read(path).map_err(|why| format!("cannot read it: {why}"))?;
    let file: File = serde_json::from_slice(&json).map_err(|why| format!("not a file of path mapping rules: {why}"))?;
    if file.version.as_deref().is_some_and(|version| version != "pathmapping-1.0") {
        return Err("a file of path mapping rules of another version than pathmapping-1.0".into());
    }
    file.path_mapping_rules.into_iter().map(rule).collect()
}

fn rule(rule: Rule) -> Result<PathRule, String> {
    let format = match rule.source_path_format.to_ascii_uppercase().as_str() {
        "POSIX" => PathFormat::Posix,
        "WINDOWS" => PathFormat::Windows,
        // Such paths are of no file system.
        other => return Err(format!("paths of the format \"{other}\" are not known; POSIX and WINDOWS are")),
    };
    Ok(PathRule { format, from: rule.source_path, to: rule.destination_path })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rules_come_from_the_command_line_and_from_files() {
        let folder = tempfile::tempdir().unwrap();
        let file = |text: &str| {
            let path = folder.path().join("rules.json");
            std::fs::write(&path, text).unwrap();
            rules(path.to_str().unwrap())
        };
        let rule = |format, from: &str, to: &str| PathRule { format, from: from.into(), to: to.into() };
        assert_eq!(*rules("/a=/b c").unwrap(), [rule(PathFormat::Posix, "/a", "/b c")]);
        assert_eq!(*rules(r"P:\a=/b").unwrap(), [rule(PathFormat::Windows, r"P:\a", "/b")]);
        let json = r#"{ "version": "pathmapping-1.0", "path_mapping_rules": [
            { "source_path_format": "WINDOWS", "source_path": "P:\\a", "destination_path": "/b" } ] }"#;
        assert_eq!(*file(json).unwrap(), [rule(PathFormat::Windows, r"P:\a", "/b")]);
        assert!(file("{}").unwrap().is_empty());
        for wrong in ["", "[]", &json.replace("1.0", "2.0"), &json.replace("WINDOWS", "URI")] {
            file(wrong).unwrap_err();
        }
        for wrong in ["/a", "=/b", "/a=", "none.json"] {
            rules(wrong).unwrap_err();
        }
    }
}
