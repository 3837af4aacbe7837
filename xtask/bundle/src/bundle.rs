//! The modules of the page as one script, and the page in one file.
//!
//! A browser loads no modules from the disk. The page's modules keep to a few forms (`import { a, b as c }
//! from "./x.js";` and `import * as x from "./x.js";` on a line of their own, `export` before functions,
//! constants and classes), so that each can be put into a function that returns what it exports.

use std::collections::BTreeMap;
use std::fmt::Write as _;

/// Why the page cannot be put into one script.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
pub(crate) enum BundleError {
    /// A module is imported but is not there.
    #[error("{importer} imports {name}, which is not a file of the page")]
    Missing {
        /// The module that imports.
        importer: String,
        /// The module that it imports.
        name: String,
    },
    /// Modules import each other.
    #[error("{0} imports itself through other modules")]
    Circle(String),
    /// A line has another form than those above.
    #[error("{name}: `{line}` has none of the forms that can be put into one script")]
    Form {
        /// The module.
        name: String,
        /// The line.
        line: String,
    },
}

/// The modules that `main` needs, and itself, as one script.
pub(crate) fn script(
    modules: &BTreeMap<String, String>,
    main: &str,
) -> Result<String, BundleError> {
    let mut bundle = Bundle {
        modules,
        open: Vec::new(),
        done: Vec::new(),
        script: String::from("\"use strict\";\n"),
    };
    bundle.add(main, main)?;
    Ok(bundle.script)
}

struct Bundle<'a> {
    modules: &'a BTreeMap<String, String>,
    /// Modules whose imports are being added.
    open: Vec<String>,
    done: Vec<String>,
    script: String,
}

impl Bundle<'_> {
    /// Adds a module after those that it imports.
    fn add(&mut self, name: &str, importer: &str) -> Result<(), BundleError> {
        if self.done.iter().any(|done| done == name) {
            return Ok(());
        }
        if self.open.iter().any(|open| open == name) {
            return Err(BundleError::Circle(name.to_owned()));
        }
        let text = self.modules.get(name).ok_or_else(|| BundleError::Missing {
            importer: importer.to_owned(),
            name: name.to_owned(),
        })?;
        self.open.push(name.to_owned());
        let mut body = String::new();
        let mut exported = Vec::new();
        for line in text.lines() {
            let refused = || BundleError::Form {
                name: name.to_owned(),
                line: line.to_owned(),
            };
            if line.starts_with("import ") {
                let (pattern, from) = import(line).ok_or_else(refused)?;
                self.add(from, name)?;
                let _ = writeln!(body, "const {pattern} = {};", variable(from));
            } else if let Some(rest) = line.strip_prefix("export ") {
                if rest.starts_with('{') {
                    exported.extend(names(rest).ok_or_else(refused)?);
                } else {
                    exported.push(declared(rest).ok_or_else(refused)?.to_owned());
                    body.push_str(rest);
                    body.push('\n');
                }
            } else {
                body.push_str(line);
                body.push('\n');
            }
        }
        let _ = writeln!(
            self.script,
            "const {} = (() => {{\n{body}return {{ {} }};\n}})();",
            variable(name),
            exported.join(", ")
        );
        self.open.pop();
        self.done.push(name.to_owned());
        Ok(())
    }
}

/// What an import binds, as a pattern, and the module that it is from.
fn import(line: &str) -> Option<(String, &str)> {
    let (bound, from) = line
        .strip_prefix("import ")?
        .strip_suffix("\";")?
        .split_once(" from \"./")?;
    let pattern = match bound.strip_prefix("* as ") {
        Some(name) => name.to_owned(),
        None if bound.starts_with('{') => bound.replace(" as ", ": "),
        None => return None,
    };
    Some((pattern, from))
}

/// The names of `{ a, b };`.
fn names(list: &str) -> Option<Vec<String>> {
    let inside = list.strip_prefix('{')?.strip_suffix("};")?;
    let names = inside.split(',').map(|name| name.trim().to_owned());
    Some(names.filter(|name| !name.is_empty()).collect())
}

/// The name that a declaration gives. A variable that changes would be a copy where it is imported.
fn declared(declaration: &str) -> Option<&str> {
    let rest = [
        "const ",
        "class ",
        "async function* ",
        "async function ",
        "function* ",
        "function ",
    ]
    .iter()
    .find_map(|start| declaration.strip_prefix(start))?;
    let end = rest.find(|c: char| !c.is_alphanumeric() && c != '_' && c != '$')?;
    (end > 0).then(|| &rest[..end])
}

/// The variable that holds what a module exports.
fn variable(name: &str) -> String {
    let plain = name.strip_suffix(".js").unwrap_or(name);
    format!(
        "module_{}",
        plain.replace(|c: char| !c.is_alphanumeric(), "_")
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(modules: &[(&str, &str)]) -> Result<String, BundleError> {
        let modules = modules
            .iter()
            .map(|(name, text)| ((*name).into(), (*text).into()));
        script(&modules.collect(), "main.js")
    }

    #[test]
    fn modules_come_after_what_they_import_and_each_once() {
        let script = of(&[
            (
                "a.js",
                "import { c } from \"./c.js\";\nexport const a = c();\n",
            ),
            (
                "c.js",
                "const own = 1;\nexport function c() { return own; }\n",
            ),
            (
                "main.js",
                "import { a as b } from \"./a.js\";\nimport * as c from \"./c.js\";\nb(c);\n",
            ),
        ]);
        assert_eq!(
            script.unwrap(),
            "\"use strict\";\n\
             const module_c = (() => {\nconst own = 1;\nfunction c() { return own; }\nreturn { c };\n})();\n\
             const module_a = (() => {\nconst { c } = module_c;\nconst a = c();\nreturn { a };\n})();\n\
             const module_main = (() => {\nconst { a: b } = module_a;\nconst c = module_c;\nb(c);\nreturn {  };\n})();\n"
        );
    }

    #[test]
    fn what_cannot_be_put_into_one_script_is_refused() {
        let refused = of(&[("main.js", "import { a } from \"./none.js\";")]).unwrap_err();
        assert!(refused.to_string().contains("none.js"));
        let circle = [
            ("a.js", "import { b } from \"./main.js\";\n"),
            ("main.js", "import { a } from \"./a.js\";\n"),
        ];
        assert_eq!(of(&circle), Err(BundleError::Circle("main.js".into())));
        for line in [
            "export let a = 1;",
            "import a from \"./a.js\";",
            "export default 1;",
        ] {
            assert!(
                matches!(of(&[("main.js", line)]), Err(BundleError::Form { .. })),
                "{line}"
            );
        }
    }
}
