//! Words in scripts: quoted so that the shell, or `sbatch` in its `#SBATCH` lines, reads back what was meant.

use crate::{Error, Place, Result};

/// Characters that neither the shell nor `sbatch` gives a meaning, wherever they stand in a word. `=` is not among
/// them: before a command it makes an assignment.
fn is_plain(c: char) -> bool {
    c.is_ascii_alphanumeric() || "_-./:,+@%".contains(c)
}

/// One word of a POSIX shell: as it is where nothing in it is special, else in single quotes. For commands in messages.
pub fn quoted_word(word: &str) -> String {
    match !word.is_empty() && word.chars().all(is_plain) {
        true => word.to_owned(),
        false => format!("'{}'", word.replace('\'', r"'\''")),
    }
}

/// The same for a word of a script.
///
/// # Errors
/// [`Error::Usage`] naming `place` for control characters (line breaks among them), which could be quoted but not read
/// in a script by a person.
pub fn shell_quoted(place: Place, word: &str) -> Result<String> {
    refuse_control(place, word)?;
    Ok(quoted_word(word))
}

/// The value of an option in an `#SBATCH` line, by the rules of `sbatch`: double quotes around, a backslash before
/// quotes and backslashes; `$` and `` ` `` mean nothing there.
///
/// # Errors
/// [`Error::Usage`] naming `place` for control characters.
pub fn directive_quoted(place: Place, value: &str) -> Result<String> {
    refuse_control(place, value)?;
    if !value.is_empty() && value.chars().all(is_plain) {
        return Ok(value.to_owned());
    }
    Ok(format!("\"{}\"", value.replace('\\', r"\\").replace('"', "\\\"")))
}

/// A file name pattern of `sbatch` in a folder: `name` keeps its `%` (`%A`, `%a`, `%j`), those of the folder are taken
/// literally.
///
/// # Errors
/// [`Error::Usage`] for a folder with a backslash, after which Slurm takes no pattern, or with control characters.
pub fn log_pattern(place: Place, folder: &str, name: &str) -> Result<String> {
    if folder.contains('\\') {
        let problem =
            format!("Slurm cannot write logs to `{folder}`: a backslash in a path ends its file name patterns");
        return Err(Error::usage(place, problem, "choose a folder without a backslash in its path"));
    }
    directive_quoted(place, &format!("{}/{name}", folder.replace('%', "%%")))
}

fn refuse_control(place: Place, word: &str) -> Result<()> {
    if word.chars().any(char::is_control) {
        let problem = format!("`{}` holds a line break or another control character", word.escape_debug());
        return Err(Error::usage(place, problem, "write it without; a file can be renamed"));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plain_words_stay_readable() {
        for word in ["study", "--config", "a/b-1.toml", "paper,0.4", "64+1", "user@host:x", "50%"] {
            assert_eq!(shell_quoted(Place::item("x"), word).unwrap(), word);
            assert_eq!(directive_quoted(Place::item("x"), word).unwrap(), word);
        }
    }

    #[test]
    fn the_shell_reads_back_what_was_meant() {
        let words = [
            "", " ", "my data", "it's", "\"", "$HOME", "`id`", "$(id)", "a\\", "a;b", "*", "~", "x=1", "#", "!", "ä",
            "&", "'",
        ];
        for word in words {
            let quoted = shell_quoted(Place::item("x"), word).unwrap();
            let echoed = std::process::Command::new("sh").args(["-c", &format!("printf %s {quoted}")]).output();
            assert_eq!(String::from_utf8(echoed.unwrap().stdout).unwrap(), word, "{quoted}");
        }
    }

    #[test]
    fn line_breaks_are_refused_with_the_option() {
        for word in ["a\nb", "a\rb", "\t", "a\0b", "\u{1b}[0m"] {
            let error = shell_quoted(Place::option("out"), word).unwrap_err();
            assert!(matches!(error, Error::Usage { .. }));
            assert!(error.to_string().starts_with("option `out`: "), "{error}");
            assert!(directive_quoted(Place::option("out"), word).is_err());
        }
    }

    #[test]
    fn directives_follow_sbatch() {
        assert_eq!(directive_quoted(Place::item("x"), "my data").unwrap(), "\"my data\"");
        assert_eq!(directive_quoted(Place::item("x"), "a\"b\\c").unwrap(), r#""a\"b\\c""#);
        assert_eq!(log_pattern(Place::item("x"), "/out/slurm", "%A_%a.log").unwrap(), "/out/slurm/%A_%a.log");
        assert_eq!(log_pattern(Place::item("x"), "/my 50%", "%A.log").unwrap(), "\"/my 50%%/%A.log\"");
        assert!(log_pattern(Place::option("out"), "/a\\b", "%A.log").unwrap_err().to_string().contains("backslash"));
    }
}
