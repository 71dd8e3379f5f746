//! Parameters have names: no signature destructures a tuple.
//!
//! The check is syntactic and covers all functions and methods, private ones included, except closures.

use super::{CRATES, only_in_tests, sources_of};
use syn::visit::{self, Visit};

/// Maximum number of destructured tuples.
const MOST: usize = 15;

/// Collects the tuples destructured in signatures of a file.
struct Collector {
    file: String,
    found: Vec<String>,
}

impl<'ast> Visit<'ast> for Collector {
    fn visit_item_mod(&mut self, module: &'ast syn::ItemMod) {
        if !only_in_tests(&module.attrs) {
            visit::visit_item_mod(self, module);
        }
    }

    fn visit_item_fn(&mut self, item: &'ast syn::ItemFn) {
        if !only_in_tests(&item.attrs) {
            visit::visit_item_fn(self, item);
        }
    }

    fn visit_item_impl(&mut self, item: &'ast syn::ItemImpl) {
        if !only_in_tests(&item.attrs) {
            visit::visit_item_impl(self, item);
        }
    }

    fn visit_impl_item_fn(&mut self, item: &'ast syn::ImplItemFn) {
        if !only_in_tests(&item.attrs) {
            visit::visit_impl_item_fn(self, item);
        }
    }

    fn visit_signature(&mut self, signature: &'ast syn::Signature) {
        for input in &signature.inputs {
            if let syn::FnArg::Typed(input) = input
                && has_tuple(&input.pat)
            {
                self.found.push(format!("{} {}", self.file, signature.ident));
            }
        }
    }
}

/// Returns whether a pattern destructures a tuple; `()` does not count.
fn has_tuple(pattern: &syn::Pat) -> bool {
    match pattern {
        syn::Pat::Tuple(tuple) => !tuple.elems.is_empty(),
        syn::Pat::Reference(reference) => has_tuple(&reference.pat),
        syn::Pat::Paren(paren) => has_tuple(&paren.pat),
        syn::Pat::Slice(slice) => slice.elems.iter().any(has_tuple),
        syn::Pat::Struct(fields) => fields.fields.iter().any(|field| has_tuple(&field.pat)),
        syn::Pat::TupleStruct(fields) => fields.elems.iter().any(has_tuple),
        _ => false,
    }
}

#[test]
fn parameters_are_hardly_ever_tuples() {
    let mut found = Vec::new();
    // Omit test modules of a crate, which are in folders called `tests`.
    let sources = CRATES.iter().flat_map(|name| sources_of(name)).filter(|(file, _)| !file.contains("/tests/"));
    for (file, source) in sources {
        let mut collector = Collector { file, found: Vec::new() };
        collector.visit_file(&source);
        found.extend(collector.found);
    }
    assert!(found.len() <= MOST, "{} tuples in signatures, at most {MOST}: {found:#?}", found.len());
}
