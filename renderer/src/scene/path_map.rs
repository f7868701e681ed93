//! Where files are on this machine that a scene has by their places on another one.

use std::path::PathBuf;

/// How paths were written where the scene was made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PathFormat {
    /// Parts are divided by `/`, and capitals matter.
    #[default]
    Posix,
    /// Parts are divided by `\` or `/`, and capitals do not matter.
    Windows,
}

/// Paths that begin with `from` begin with `to` here.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PathRule {
    /// How `from` is written.
    pub format: PathFormat,
    /// A folder or a file, by whole parts: `/a` is no beginning of `/ab`.
    pub from: String,
    /// What stands for it.
    pub to: String,
}

impl PathRule {
    /// What is left of a name behind `from`, without a divider; `None` if it does not begin so.
    fn rest(&self, name: &str) -> Option<String> {
        let plain = |text: &str| match self.format {
            PathFormat::Posix => text.to_owned(),
            PathFormat::Windows => text.replace('\\', "/"),
        };
        let (name, from) = (plain(name), plain(&self.from));
        let from = from.trim_end_matches('/');
        let (begin, rest) = name.split_at_checked(from.len())?;
        let same = match self.format {
            PathFormat::Posix => begin == from,
            PathFormat::Windows => begin.eq_ignore_ascii_case(from),
        };
        (same && (rest.is_empty() || rest.starts_with('/'))).then(|| rest.trim_start_matches('/').to_owned())
    }
}

/// Rules for the paths in a scene's files. Of several that fit, the one with the longest beginning counts, or the first of
/// these.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct PathMap(Vec<PathRule>);

impl PathMap {
    /// The path that a name in a scene stands for.
    pub fn apply(&self, name: &str) -> PathBuf {
        let fits = |rule: &PathRule| rule.rest(name).map(|rest| (rule.from.len(), rule.to.clone(), rest));
        // The first of the longest: `max_by_key` takes the last.
        match self.0.iter().rev().filter_map(fits).max_by_key(|(length, ..)| *length) {
            Some((_, to, rest)) if rest.is_empty() => to.into(),
            Some((_, to, rest)) => PathBuf::from(to).join(rest),
            None => name.into(),
        }
    }
}

impl FromIterator<PathRule> for PathMap {
    fn from_iter<I: IntoIterator<Item = PathRule>>(rules: I) -> Self {
        Self(rules.into_iter().collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_parts_are_mapped_by_the_longest_rule() {
        let rule = |format, from: &str, to: &str| PathRule { format, from: from.into(), to: to.into() };
        let map = PathMap::from_iter([
            rule(PathFormat::Posix, "/jobs", "/mnt/jobs"),
            rule(PathFormat::Posix, "/jobs/shot/", "/fast"),
            rule(PathFormat::Posix, "/jobs/shot", "/never"),
            rule(PathFormat::Windows, r"P:\Show", "/mnt/show"),
        ]);
        for (name, path) in [
            ("/jobs/tex/a.exr", "/mnt/jobs/tex/a.exr"),
            ("/jobs/shot/a.exr", "/fast/a.exr"),
            ("/jobs", "/mnt/jobs"),
            ("/jobsworth/a.exr", "/jobsworth/a.exr"),
            ("/Jobs/a.exr", "/Jobs/a.exr"),
            (r"p:\SHOW\tex\a.exr", "/mnt/show/tex/a.exr"),
            ("P:/show/a.exr", "/mnt/show/a.exr"),
            ("textures/a.exr", "textures/a.exr"),
            ("", ""),
        ] {
            assert_eq!(map.apply(name), PathBuf::from(path), "{name}");
        }
    }
}
