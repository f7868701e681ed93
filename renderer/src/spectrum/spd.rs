//! Spectra from text: `.spd` files.

use super::Spectrum;

/// Why numbers are no spectrum.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SpectrumError {
    /// A word of the text is not a number.
    #[error(
        "line {line}: `{word}` is not a number; a spectrum is pairs of wavelength (nm) and value, `#` starts a comment"
    )]
    NotANumber {
        /// Counted from 1.
        line: usize,
        /// What is there.
        word: String,
    },
    /// The last wavelength has no value.
    #[error("{count} numbers: a spectrum is pairs of wavelength (nm) and value, so their number must be even")]
    Unpaired {
        /// How many numbers there are.
        count: usize,
    },
    /// No samples.
    #[error("the spectrum is empty; give at least one pair of wavelength (nm) and value")]
    Empty,
    /// A number is infinite or not a number, or a wavelength is not positive.
    #[error("sample {index} is ({lambda}, {value}); wavelengths must be positive and all numbers finite")]
    Unusable {
        /// Counted from 1.
        index: usize,
        /// Wavelength, nm.
        lambda: f32,
        /// Value.
        value: f32,
    },
    /// Wavelengths out of order.
    #[error("sample {index} has wavelength {lambda} nm after {previous} nm; wavelengths must increase")]
    NotIncreasing {
        /// Counted from 1.
        index: usize,
        /// Wavelength, nm.
        lambda: f32,
        /// The one before it.
        previous: f32,
    },
}

/// The spectrum in the text of an `.spd` file: wavelengths (nm) and values in turn, separated by white space; `#` starts a
/// comment.
pub fn read_spd(text: &str) -> Result<Spectrum, SpectrumError> {
    let mut numbers: Vec<f32> = Vec::new();
    for (index, line) in text.lines().enumerate() {
        let data = line.split('#').next().unwrap_or_default();
        for word in data.split_whitespace() {
            let number = word.parse().map_err(|_| SpectrumError::NotANumber { line: index + 1, word: word.into() })?;
            numbers.push(number);
        }
    }
    if numbers.len() % 2 != 0 {
        return Err(SpectrumError::Unpaired { count: numbers.len() });
    }
    let samples: Vec<(f32, f32)> = numbers.chunks_exact(2).map(|pair| (pair[0], pair[1])).collect();
    Spectrum::sampled(&samples)
}

/// Whether samples make a spectrum.
pub(super) fn check(samples: &[(f32, f32)]) -> Result<(), SpectrumError> {
    if samples.is_empty() {
        return Err(SpectrumError::Empty);
    }
    for (i, &(lambda, value)) in samples.iter().enumerate() {
        let index = i + 1;
        if !(lambda > 0.0 && lambda.is_finite() && value.is_finite()) {
            return Err(SpectrumError::Unusable { index, lambda, value });
        }
        if i > 0 && samples[i - 1].0 >= lambda {
            return Err(SpectrumError::NotIncreasing { index, lambda, previous: samples[i - 1].0 });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn files_are_read_and_faults_are_named() {
        let spectrum = read_spd("# measured\n400 0.25\n\t500 1 # peak\r\n 600.5\n-1e-1\n").unwrap();
        assert_eq!(spectrum, Spectrum::Sampled([(400.0, 0.25), (500.0, 1.0), (600.5, -0.1)].into()));
        assert_eq!(read_spd("400 1\n500 x"), Err(SpectrumError::NotANumber { line: 2, word: "x".into() }));
        assert_eq!(read_spd("400 1 500"), Err(SpectrumError::Unpaired { count: 3 }));
        assert_eq!(read_spd("# nothing"), Err(SpectrumError::Empty));
        assert_eq!(
            read_spd("500 1 400 2"),
            Err(SpectrumError::NotIncreasing { index: 2, lambda: 400.0, previous: 500.0 })
        );
        assert!(matches!(read_spd("400 inf"), Err(SpectrumError::Unusable { index: 1, .. })));
        assert!(matches!(read_spd("-4 1"), Err(SpectrumError::Unusable { index: 1, .. })));
    }

    proptest! {
        #[test]
        fn no_text_panics(text in "[0-9 .#einaf\n+-]{0,80}") {
            if let Ok(spectrum) = read_spd(&text) {
                prop_assert!(spectrum.reflectance_rgb().is_finite());
                prop_assert!(spectrum.illuminant_rgb().is_finite());
            }
        }
    }
}
