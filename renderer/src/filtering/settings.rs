//! Settings of filters by name, as command lines and the metadata of images have them.

use filter::talk::{self, Eviction, Jitter, LevelOfDetail, Reading};

use super::{AUTO, Blend, Filtering, Selection};

/// A setting that a filter does not have or does not take. The message says what it would take.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SettingError {
    /// There is no such setting.
    #[error("the filter \"{filter}\" has no setting \"{key}\"; it has {known}")]
    Unknown {
        /// The filter's name.
        filter: &'static str,
        /// What was asked for.
        key: String,
        /// All settings and their values, or "none".
        known: String,
    },
    /// The value makes no sense.
    #[error("the filter's setting {key} cannot be \"{value}\": it must be {values}")]
    Value {
        /// The setting.
        key: &'static str,
        /// What was asked for.
        value: String,
        /// What it may be.
        values: &'static str,
    },
    /// The settings do not go together.
    #[error("the filter's settings do not go together: {0}")]
    Together(#[from] talk::ParamsError),
}

/// One setting of `T`.
struct Setting<T> {
    key: &'static str,
    /// What it may be, in words.
    values: &'static str,
    get: fn(&T) -> String,
    /// False if the value makes no sense.
    set: fn(&mut T, &str) -> bool,
}

/// A number between two bounds, both inclusive.
macro_rules! number {
    ($key:literal, $($field:ident).+: $kind:ty, $least:literal, $most:literal) => {
        Setting {
            key: $key,
            values: concat!($least, " to ", $most),
            get: |all| all.$($field).+.to_string(),
            set: |all, text| {
                let value = text.parse().ok().filter(|value| ($least as $kind..=$most as $kind).contains(value));
                value.map(|value| all.$($field).+ = value).is_some()
            },
        }
    };
}

/// A number above 0.
macro_rules! positive {
    ($key:literal, $($field:ident).+: $kind:ty) => {
        Setting {
            key: $key,
            values: "above 0",
            get: |all| all.$($field).+.to_string(),
            set: |all, text| {
                let value = text.parse().ok().filter(|value: &$kind| *value > 0.0 && value.is_finite());
                value.map(|value| all.$($field).+ = value).is_some()
            },
        }
    };
}

/// A number above 0, or one that is decided by the frame's samples.
macro_rules! measured {
    ($key:literal, $($field:ident).+: $kind:ty) => {
        Setting {
            key: $key,
            values: "auto or above 0",
            get: |all| if all.$($field).+ == AUTO { "auto".into() } else { all.$($field).+.to_string() },
            set: |all, text| {
                let number = text.parse().ok().filter(|value: &$kind| *value > 0.0 && value.is_finite());
                let value = if text == "auto" { Some(AUTO) } else { number };
                value.map(|value| all.$($field).+ = value).is_some()
            },
        }
    };
}

/// A number from 1 to a largest one, or one that is decided by the frame's samples: 0 until it is.
macro_rules! count {
    ($key:literal, $($field:ident).+: $kind:ty, $largest:literal) => {
        Setting {
            key: $key,
            values: concat!("auto or 1 to ", $largest),
            get: |all| if all.$($field).+ == 0 { "auto".into() } else { all.$($field).+.to_string() },
            set: |all, text| {
                let number = text.parse().ok().filter(|value: &$kind| (1..=$largest).contains(value));
                let value = if text == "auto" { Some(0) } else { number };
                value.map(|value| all.$($field).+ = value).is_some()
            },
        }
    };
}

/// Yes or no.
macro_rules! switch {
    ($key:literal, $($field:ident).+) => {
        Setting {
            key: $key,
            values: "on or off",
            get: |all| if all.$($field).+ { "on" } else { "off" }.into(),
            set: |all, text| {
                let value = match text {
                    "on" => Some(true),
                    "off" => Some(false),
                    _ => None,
                };
                value.map(|value| all.$($field).+ = value).is_some()
            },
        }
    };
}

/// All that decides what the adaptive filter does.
struct AdaptiveSettings {
    params: filter::Params,
    blend: Blend,
}

/// All that decides what the talk's filter does.
struct TalkSettings {
    params: talk::Params,
    selection: Selection,
}

const ADAPTIVE: &[Setting<AdaptiveSettings>] = &[
    number!("trees", params.trees: u32, 1, 8),
    count!("reads", params.reads: u32, 8),
    number!("second_trees", params.second_trees: u32, 1, 8),
    measured!("leaf", params.leaf: f32),
    measured!("second_leaf", params.second_leaf: f32),
    count!("epoch", params.epoch: u64, 1_000_000_000),
    switch!("growing", params.growing),
    number!("certain", params.shrinkage.certain: f64, 0, 1000),
    number!("inherited", params.shrinkage.inherited: f64, 0, 1),
    number!("trusted", params.shrinkage.trusted: f64, 1, 1000000),
    number!("levels", params.shrinkage.levels: u32, 0, 16),
    number!("doubt", blend.doubt: f32, 0, 1000),
];

const TALK: &[Setting<TalkSettings>] = &[
    Setting {
        key: "vertex",
        values: "primary, secondary or tertiary",
        get: |all| ["primary", "secondary", "tertiary"][all.selection as usize].into(),
        set: |all, text| {
            let value = match text {
                "primary" => Selection::Primary,
                "secondary" => Selection::Secondary,
                "tertiary" => Selection::Tertiary,
                _ => return false,
            };
            all.selection = value;
            true
        },
    },
    Setting {
        key: "level",
        values: "fixed, distance or footprint",
        get: |all| {
            match all.params.level {
                LevelOfDetail::Fixed { .. } => "fixed",
                LevelOfDetail::Distance { .. } => "distance",
                LevelOfDetail::Footprint { .. } => "footprint",
            }
            .into()
        },
        set: |all, text| {
            let side = *side(&mut all.params.level);
            all.params.level = match text {
                "fixed" => LevelOfDetail::Fixed { side },
                "distance" => LevelOfDetail::Distance { side },
                "footprint" => LevelOfDetail::Footprint { side },
                _ => return false,
            };
            true
        },
    },
    Setting {
        key: "side",
        values: "above 0",
        get: |all| side(&mut all.params.level.clone()).to_string(),
        set: |all, text| {
            let value = text.parse().ok().filter(|value: &f32| *value > 0.0 && value.is_finite());
            value.map(|value| *side(&mut all.params.level) = value).is_some()
        },
    },
    Setting {
        key: "jitter",
        values: "none, square or disk",
        get: |all| {
            match all.params.jitter {
                Jitter::None => "none",
                Jitter::Square { .. } => "square",
                Jitter::Disk { .. } => "disk",
            }
            .into()
        },
        set: |all, text| {
            let radius = radius(all.params.jitter);
            all.params.jitter = match text {
                "none" => Jitter::None,
                "square" => Jitter::Square { radius },
                "disk" => Jitter::Disk { radius },
                _ => return false,
            };
            true
        },
    },
    Setting {
        key: "jitter_radius",
        values: "0 to 8, and with jitter=none it has no meaning",
        get: |all| radius(all.params.jitter).to_string(),
        set: |all, text| {
            let Some(value) = text.parse().ok().filter(|value| (0.0..=8.0).contains(value)) else { return false };
            match &mut all.params.jitter {
                Jitter::None => return false,
                Jitter::Square { radius } | Jitter::Disk { radius } => *radius = value,
            }
            true
        },
    },
    number!("normal_bins", params.normal_bins: u32, 0, 255),
    number!("normal_jitter", params.normal_jitter: f32, 0, 4),
    switch!("surface", params.surface),
    switch!("direction", params.direction),
    switch!("layers", params.layers),
    number!("glossy_finer", params.glossy_finer: f32, 1, 1024),
    number!("lookups", params.lookups: u32, 1, 4),
    number!("enough", params.enough: u32, 0, 1000000),
    Setting {
        key: "relative_variance",
        values: "0 or more, or inf",
        get: |all| all.params.relative_variance.to_string(),
        set: |all, text| {
            let value = text.parse().ok().filter(|value: &f32| *value >= 0.0);
            value.map(|value| all.params.relative_variance = value).is_some()
        },
    },
    number!("probes", params.probes: u32, 1, 255),
    positive!("table_size", params.table_size: f32),
    number!("verification_bits", params.verification_bits: u32, 1, 57),
    Setting {
        key: "temporal",
        values: "none, or 0 to less than 1",
        get: |all| all.params.temporal.map_or("none".into(), |alpha| alpha.to_string()),
        set: |all, text| {
            let alpha = text.parse().ok().filter(|alpha| (0.0..1.0).contains(alpha));
            all.params.temporal = alpha;
            alpha.is_some() || text == "none"
        },
    },
    Setting {
        key: "reading",
        values: "every-pass or at-the-end",
        get: |all| if all.params.reading == Reading::EveryPass { "every-pass" } else { "at-the-end" }.into(),
        set: |all, text| {
            all.params.reading = match text {
                "every-pass" => Reading::EveryPass,
                "at-the-end" => Reading::AtTheEnd,
                _ => return false,
            };
            true
        },
    },
    Setting {
        key: "eviction",
        values: "never, recent or health (which need reading=every-pass)",
        get: |all| {
            match all.params.eviction {
                Eviction::Never => "never",
                Eviction::LeastRecent { .. } => "recent",
                Eviction::Health { .. } => "health",
            }
            .into()
        },
        set: |all, text| {
            let patience = patience(all.params.eviction);
            all.params.eviction = match text {
                "never" => Eviction::Never,
                "recent" => Eviction::LeastRecent { patience },
                "health" => Eviction::Health { patience },
                _ => return false,
            };
            true
        },
    },
    Setting {
        key: "patience",
        values: "1 to 126, and with eviction=never it has no meaning",
        get: |all| patience(all.params.eviction).to_string(),
        set: |all, text| {
            let Some(value) = text.parse().ok().filter(|value| (1..=126).contains(value)) else { return false };
            match &mut all.params.eviction {
                Eviction::Never => return false,
                Eviction::LeastRecent { patience } | Eviction::Health { patience } => *patience = value,
            }
            true
        },
    },
];

fn side(level: &mut LevelOfDetail) -> &mut f32 {
    let (LevelOfDetail::Fixed { side } | LevelOfDetail::Distance { side } | LevelOfDetail::Footprint { side }) = level;
    side
}

/// The radius of a jitter, or of the one that would replace none.
fn radius(jitter: Jitter) -> f32 {
    match jitter {
        Jitter::None => 0.5,
        Jitter::Square { radius } | Jitter::Disk { radius } => radius,
    }
}

/// The patience of an eviction, or of the one that would replace none.
fn patience(eviction: Eviction) -> u32 {
    match eviction {
        Eviction::Never => 2,
        Eviction::LeastRecent { patience } | Eviction::Health { patience } => patience,
    }
}

impl Filtering {
    /// Names of all filters, that of none among them.
    pub const NAMES: [&'static str; 3] = ["none", "talk", "adaptive"];

    /// The filter of a name, with the settings that serve still images best.
    pub fn named(name: &str) -> Option<Self> {
        let talk = talk::Params { reading: Reading::AtTheEnd, ..talk::Params::default() };
        match name {
            "none" => Some(Self::None),
            "talk" => Some(Self::Talk(talk, Selection::default())),
            "adaptive" => {
                let params = filter::Params { reads: 0, leaf: AUTO, second_leaf: AUTO, ..filter::Params::default() };
                Some(Self::Adaptive(params, Blend::default()))
            }
            _ => None,
        }
    }

    /// The filter's name.
    pub fn name(&self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Talk(..) => "talk",
            Self::Adaptive(..) => "adaptive",
        }
    }

    /// Changes a setting. Some only go together with others: [`Self::validate`] knows.
    ///
    /// # Errors
    /// There is no such setting, or it cannot be so.
    pub fn set(&mut self, key: &str, value: &str) -> Result<(), SettingError> {
        let filter = self.name();
        match self {
            Self::None => Err(unknown::<()>(filter, &[], key)),
            Self::Talk(params, selection) => {
                let mut all = TalkSettings { params: *params, selection: *selection };
                set(filter, TALK, &mut all, key, value)?;
                (*params, *selection) = (all.params, all.selection);
                Ok(())
            }
            Self::Adaptive(params, blend) => {
                let mut all = AdaptiveSettings { params: *params, blend: *blend };
                set(filter, ADAPTIVE, &mut all, key, value)?;
                (*params, *blend) = (all.params, all.blend);
                Ok(())
            }
        }
    }

    /// All settings and their values.
    pub fn settings(&self) -> Vec<(&'static str, String)> {
        self.described().into_iter().map(|(key, _, value)| (key, value)).collect()
    }

    /// All settings, what they may be and what they are.
    pub(super) fn described(&self) -> Vec<(&'static str, &'static str, String)> {
        fn values<T>(settings: &[Setting<T>], all: &T) -> Vec<(&'static str, &'static str, String)> {
            settings.iter().map(|setting| (setting.key, setting.values, (setting.get)(all))).collect()
        }
        match *self {
            Self::None => Vec::new(),
            Self::Talk(params, selection) => values(TALK, &TalkSettings { params, selection }),
            Self::Adaptive(params, blend) => values(ADAPTIVE, &AdaptiveSettings { params, blend }),
        }
    }

    /// Whether all settings are within their bounds and go together.
    ///
    /// # Errors
    /// The first that is not.
    pub fn validate(&self) -> Result<(), SettingError> {
        match self {
            Self::None => Ok(()),
            Self::Talk(params, _) => Ok(params.validate()?),
            // What a setting says of itself it must also take.
            Self::Adaptive(..) => {
                let mut copy = *self;
                self.settings().into_iter().try_for_each(|(key, value)| copy.set(key, &value))
            }
        }
    }
}

fn set<T>(
    filter: &'static str,
    settings: &[Setting<T>],
    all: &mut T,
    key: &str,
    value: &str,
) -> Result<(), SettingError> {
    let setting = settings.iter().find(|setting| setting.key == key).ok_or_else(|| unknown(filter, settings, key))?;
    if (setting.set)(all, value) {
        return Ok(());
    }
    Err(SettingError::Value { key: setting.key, value: value.to_owned(), values: setting.values })
}

fn unknown<T>(filter: &'static str, settings: &[Setting<T>], key: &str) -> SettingError {
    let known: Vec<String> = settings.iter().map(|setting| format!("{} ({})", setting.key, setting.values)).collect();
    let known = if known.is_empty() { "none".into() } else { known.join(", ") };
    SettingError::Unknown { filter, key: key.to_owned(), known }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_filter_is_valid_as_named_and_takes_what_it_says() {
        for name in Filtering::NAMES {
            let filtering = Filtering::named(name).unwrap();
            assert_eq!(filtering.name(), name);
            assert_eq!(filtering.validate(), Ok(()));
            for (key, value) in filtering.settings() {
                let mut changed = filtering;
                // Settings without a meaning are refused.
                if (key, name) != ("patience", "talk") {
                    assert_eq!(changed.set(key, &value), Ok(()), "{key}={value}");
                }
                assert_eq!(changed, filtering, "{key}={value}");
                assert!(changed.set(key, "-1").is_err() && changed.set(key, "nan").is_err(), "{key}");
            }
        }
        assert_eq!(Filtering::named("best"), None);
    }

    #[test]
    fn settings_are_set_and_read_back() {
        let cases = [
            ("adaptive", "trees", "8", "9"),
            ("adaptive", "certain", "3.25", "-0.1"),
            ("adaptive", "levels", "0", "1.5"),
            ("adaptive", "leaf", "0.5", "0"),
            ("adaptive", "second_leaf", "auto", "-1"),
            ("adaptive", "epoch", "auto", "0"),
            ("adaptive", "epoch", "12", "always"),
            ("talk", "vertex", "tertiary", "quaternary"),
            ("talk", "level", "distance", "far"),
            ("talk", "side", "0.125", "inf"),
            ("talk", "jitter", "disk", "gauss"),
            ("talk", "jitter_radius", "0.75", "9"),
            ("talk", "layers", "off", "no"),
            ("talk", "relative_variance", "inf", "few"),
            ("talk", "eviction", "health", "often"),
            ("talk", "reading", "every-pass", "never"),
            ("talk", "probes", "255", "256"),
        ];
        for (filter, key, good, bad) in cases {
            let mut filtering = Filtering::named(filter).unwrap();
            assert_eq!(filtering.set(key, good), Ok(()));
            let read = filtering.settings().into_iter().find(|(name, _)| *name == key).unwrap().1;
            assert_eq!(read, good, "{key}");
            let error = filtering.set(key, bad).unwrap_err().to_string();
            assert!(error.contains(key) && error.contains(bad), "{error}");
        }
    }

    #[test]
    fn messages_name_what_there_is() {
        let mut filtering = Filtering::named("adaptive").unwrap();
        let error = filtering.set("probes", "3").unwrap_err().to_string();
        for word in ["\"adaptive\"", "\"probes\"", "trees (1 to 8)", "leaf (auto or above 0)"] {
            assert!(error.contains(word), "no {word} in {error}");
        }
        assert!(Filtering::None.set("trees", "1").unwrap_err().to_string().contains("it has none"));
    }

    #[test]
    fn what_does_not_go_together_is_refused() {
        let mut talk = Filtering::named("talk").unwrap();
        talk.set("eviction", "recent").unwrap();
        assert!(matches!(talk.validate(), Err(SettingError::Together(_))));
        talk.set("reading", "every-pass").unwrap();
        assert_eq!(talk.validate(), Ok(()));
        let wrong = filter::Params { trees: 0, ..filter::Params::default() };
        assert!(Filtering::Adaptive(wrong, Blend::default()).validate().is_err());
    }
}
