//! Iterator chains have at most three links; longer ones are loops.
//!
//! The check is syntactic. A link is a method that only iterators have, or that mostly iterators have; a source such as
//! `iter` is no link.

use super::{CRATES, only_in_tests, sources_of};
use syn::visit::{self, Visit};

/// Maximum number of links.
const MOST: usize = 3;
/// Names of links.
const LINKS: [&str; 42] = [
    "all",
    "any",
    "chain",
    "cloned",
    "collect",
    "copied",
    "count",
    "cycle",
    "enumerate",
    "filter",
    "filter_map",
    "find",
    "find_map",
    "flat_map",
    "flatten",
    "fold",
    "for_each",
    "inspect",
    "last",
    "map",
    "map_while",
    "max",
    "max_by",
    "max_by_key",
    "min",
    "min_by",
    "min_by_key",
    "partition",
    "position",
    "product",
    "reduce",
    "rev",
    "scan",
    "skip",
    "skip_while",
    "step_by",
    "sum",
    "take",
    "take_while",
    "try_fold",
    "unzip",
    "zip",
];

/// Collects the long chains of a file.
struct Collector {
    file: String,
    found: Vec<String>,
}

/// Returns the names of the methods that an expression calls one after the other, and the expression that they start
/// from.
fn calls(expression: &syn::Expr) -> (Vec<String>, &syn::Expr) {
    match expression {
        syn::Expr::MethodCall(call) => {
            let (mut names, start) = calls(&call.receiver);
            names.push(call.method.to_string());
            (names, start)
        }
        syn::Expr::Try(inner) => calls(&inner.expr),
        other => (Vec::new(), other),
    }
}

/// Returns the number of links among the names of methods.
fn links(names: &[String]) -> usize {
    names.iter().filter(|name| LINKS.contains(&name.as_str())).count()
}

impl Collector {
    /// Visits the arguments of all calls of a chain, and the expression that it starts from.
    fn visit_rest(&mut self, expression: &syn::Expr) {
        match expression {
            syn::Expr::MethodCall(call) => {
                call.args.iter().for_each(|argument| self.visit_expr(argument));
                self.visit_rest(&call.receiver);
            }
            syn::Expr::Try(inner) => self.visit_rest(&inner.expr),
            other => self.visit_expr(other),
        }
    }
}

impl<'ast> Visit<'ast> for Collector {
    fn visit_item_mod(&mut self, module: &'ast syn::ItemMod) {
        if !only_in_tests(&module.attrs) {
            visit::visit_item_mod(self, module);
        }
    }

    fn visit_expr(&mut self, expression: &'ast syn::Expr) {
        let (names, _) = calls(expression);
        if links(&names) > MOST {
            self.found.push(format!("{}: {}", self.file, names.join(".")));
        }
        // Visit a chain once, not once for each of its links.
        match expression {
            syn::Expr::MethodCall(_) | syn::Expr::Try(_) => self.visit_rest(expression),
            other => visit::visit_expr(self, other),
        }
    }
}

/// Returns the long chains of a source file.
fn long_chains(file: &str, source: &syn::File) -> Vec<String> {
    let mut collector = Collector { file: file.into(), found: Vec::new() };
    collector.visit_file(source);
    collector.found
}

#[test]
fn chains_of_iterators_are_short() {
    let mut found = Vec::new();
    for name in CRATES {
        for (file, source) in sources_of(name) {
            // Test modules of a crate are in folders and files of this name.
            if !file.contains("/tests/") && !file.ends_with("/tests.rs") {
                found.extend(long_chains(&file, &source));
            }
        }
    }
    assert!(found.is_empty(), "chains of more than {MOST} links: {found:#?}");
}

#[test]
fn long_chains_are_found() {
    let long = |text: &str| !long_chains("a.rs", &syn::parse_str(text).unwrap()).is_empty();
    assert!(long("fn f() { a.iter().zip(b).map(g).filter(h).collect() }"));
    assert!(long("fn f() { let a = || b.rev().map(|x| c.iter().skip(1).take(2).rev().sum())?; }"));
    assert!(!long("fn f() { a.iter().zip(b).map(|x| x.iter().rev().sum()).collect() }"));
    assert!(!long("#[cfg(test)] mod tests { fn f() { a.zip(b).map(g).filter(h).collect() } }"));
}
