//! Settings of filters on the command line, and their help.

use std::ffi::OsStr;

use clap::builder::TypedValueParser;
use clap::error::ErrorKind;
use clap::{Arg, Command, Error};
use renderer::filtering::Filtering;

use super::setting;

/// Reads KEY=VALUE. The word "help" is answered as `--help` is, by all that there is.
#[derive(Clone, Copy, Debug)]
pub struct SettingParser;

impl TypedValueParser for SettingParser {
    type Value = (String, String);

    fn parse_ref(&self, command: &Command, argument: Option<&Arg>, value: &OsStr) -> Result<Self::Value, Error> {
        if value == "help" {
            return Err(Error::raw(ErrorKind::DisplayHelp, help()));
        }
        (setting as fn(&str) -> Result<Self::Value, String>).parse_ref(command, argument, value)
    }
}

/// All settings of all filters.
fn help() -> String {
    let mut text = "Settings of --filter-set KEY=VALUE,...  Cells are cubes of space in which paths share their light; a footprint \
                    is the width of a pixel on the surface that it shows.\n"
        .to_owned();
    for name in ["adaptive", "talk"] {
        text += &format!("\n--filter {name}:\n");
        for setting in Filtering::named(name).expect("a filter of the command line").explained() {
            text += &format!(
                "  {:<18} {}\n  {:<18} {}; default: {}\n",
                setting.key, setting.about, "", setting.values, setting.value
            );
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use crate::args::Arguments;

    #[test]
    fn help_needs_no_scene_and_names_every_setting() {
        for command in
            [&["tessera", "render", "--filter-set", "help"][..], &["tessera", "render", "--filter-set=trees=2,help"]]
        {
            let answer = Arguments::try_parse_from(command).unwrap_err();
            assert_eq!((answer.exit_code(), answer.use_stderr()), (0, false));
            let text = answer.to_string();
            for words in [
                "--filter adaptive",
                "--filter talk",
                "auto or 1 to 8; default: auto",
                "patience",
                "samples that share",
            ] {
                assert!(text.contains(words), "no {words} in {text}");
            }
        }
    }
}
