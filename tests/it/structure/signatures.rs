//! Public functions return their figures, and return structs instead of tuples of mixed types.
//!
//! The check is syntactic. Public functions are `pub fn`, `pub` methods of `pub` types, and all methods of `pub` traits.

use super::type_names::public_types;
use super::{CRATES, only_in_tests, sources_of};
use std::collections::BTreeSet;
use syn::visit::{self, Visit};

/// Name endings of types that count or time work. Functions return values of these types, and do not modify a caller's
/// values.
const COUNTERS: [&str; 4] = ["Figures", "Counts", "Seconds", "Stats"];
/// Generic types to search: a tuple among their arguments is also part of the signature.
const WRAPPERS: [&str; 6] = ["Option", "Result", "Vec", "Box", "Arc", "Timed"];
/// Public functions with accepted tuples of mixed types.
const KNOWN_TUPLES: [&str; 2] =
    ["render-core/src/image_file/open_exr.rs write_layers", "support/threads/src/sequential.rs join"];

/// Public function with file, name and signature.
struct Function {
    place: String,
    signature: syn::Signature,
}

/// Collects the public functions of a file.
struct Collector {
    file: String,
    /// Public types of the crate that the file may refer to.
    types: BTreeSet<String>,
    /// Type or trait around the current item.
    owner: Option<String>,
    found: Vec<Function>,
}

impl Collector {
    fn add(&mut self, signature: &syn::Signature) {
        let owner = self.owner.as_ref().map_or(String::new(), |owner| format!("{owner}::"));
        let place = format!("{} {owner}{}", self.file, signature.ident);
        self.found.push(Function { place, signature: signature.clone() });
    }
}

fn is_public(visibility: &syn::Visibility) -> bool {
    matches!(visibility, syn::Visibility::Public(_))
}

impl<'ast> Visit<'ast> for Collector {
    fn visit_item_mod(&mut self, module: &'ast syn::ItemMod) {
        if !only_in_tests(&module.attrs) {
            visit::visit_item_mod(self, module);
        }
    }

    fn visit_item_fn(&mut self, item: &'ast syn::ItemFn) {
        if is_public(&item.vis) && !only_in_tests(&item.attrs) {
            self.add(&item.sig);
        }
    }

    fn visit_item_impl(&mut self, item: &'ast syn::ItemImpl) {
        // The trait defines the signatures of its methods.
        let owner = last_name(&item.self_ty).filter(|name| self.types.contains(name));
        if item.trait_.is_none() && owner.is_some() && !only_in_tests(&item.attrs) {
            self.owner = owner;
            visit::visit_item_impl(self, item);
            self.owner = None;
        }
    }

    fn visit_impl_item_fn(&mut self, item: &'ast syn::ImplItemFn) {
        if is_public(&item.vis) && !only_in_tests(&item.attrs) {
            self.add(&item.sig);
        }
    }

    fn visit_item_trait(&mut self, item: &'ast syn::ItemTrait) {
        if is_public(&item.vis) {
            self.owner = Some(item.ident.to_string());
            visit::visit_item_trait(self, item);
            self.owner = None;
        }
    }

    fn visit_trait_item_fn(&mut self, item: &'ast syn::TraitItemFn) {
        self.add(&item.sig);
    }
}

/// Returns the names of a file's private structs.
fn private_structs(source: &syn::File) -> Vec<String> {
    let mut names = Vec::new();
    for item in &source.items {
        if let syn::Item::Struct(item) = item
            && !is_public(&item.vis)
        {
            names.push(item.ident.to_string());
        }
    }
    names
}

/// Returns the public functions of a crate.
fn functions_of(name: &str) -> Vec<Function> {
    let (mut found, sources) = (Vec::new(), sources_of(name));
    let types: BTreeSet<String> = public_types(&sources).into_keys().collect();
    for (file, source) in sources {
        // A private type may share its name with a public type elsewhere.
        let private = private_structs(&source);
        let types = types.iter().filter(|name| !private.contains(name)).cloned().collect();
        let mut collector = Collector { file, types, owner: None, found: Vec::new() };
        collector.visit_file(&source);
        found.extend(collector.found);
    }
    assert!(!found.is_empty(), "{name} has public functions");
    found
}

/// Returns the last segment of a type's path.
fn last_name(kind: &syn::Type) -> Option<String> {
    let syn::Type::Path(path) = kind else { return None };
    path.path.segments.last().map(|segment| segment.ident.to_string())
}

/// Returns the types of the parameters, without the receiver.
fn parameters(signature: &syn::Signature) -> Vec<&syn::Type> {
    let mut types = Vec::new();
    for input in &signature.inputs {
        if let syn::FnArg::Typed(input) = input {
            types.push(&*input.ty);
        }
    }
    types
}

/// Returns whether a parameter of this type lets the function add to its caller's figures.
fn adds_to_figures(kind: &syn::Type) -> bool {
    match kind {
        syn::Type::Reference(reference) => {
            let name = last_name(&reference.elem).unwrap_or_default();
            let is_counter = COUNTERS.iter().any(|ending| name.ends_with(ending));
            // `Busy` counts through a shared reference.
            name == "Busy" || reference.mutability.is_some() && is_counter || adds_to_figures(&reference.elem)
        }
        syn::Type::Tuple(tuple) => tuple.elems.iter().any(adds_to_figures),
        syn::Type::Path(_) => contents(kind).into_iter().any(adds_to_figures),
        _ => false,
    }
}

/// Returns the types inside one of [`WRAPPERS`].
fn contents(kind: &syn::Type) -> Vec<&syn::Type> {
    let syn::Type::Path(path) = kind else { return Vec::new() };
    let Some(segment) = path.path.segments.last() else { return Vec::new() };
    let syn::PathArguments::AngleBracketed(arguments) = &segment.arguments else { return Vec::new() };
    // Look only into known wrappers.
    if !WRAPPERS.iter().any(|wrapper| segment.ident == wrapper) {
        return Vec::new();
    }
    let mut types = Vec::new();
    for argument in &arguments.args {
        if let syn::GenericArgument::Type(inner) = argument {
            types.push(inner);
        }
    }
    types
}

/// Names and symbols of a type in order, equal for equally spelled types.
#[derive(Default, PartialEq)]
struct Spelling(Vec<String>);

impl<'ast> Visit<'ast> for Spelling {
    fn visit_ident(&mut self, ident: &'ast syn::Ident) {
        self.0.push(ident.to_string());
    }

    fn visit_lit_int(&mut self, number: &'ast syn::LitInt) {
        self.0.push(number.to_string());
    }

    fn visit_type(&mut self, kind: &'ast syn::Type) {
        // Add a symbol for references, lists and tuples, so that `&T` differs from `T`.
        let sign = match kind {
            syn::Type::Reference(_) => "&",
            syn::Type::Slice(_) => "[]",
            syn::Type::Array(_) => "[;]",
            syn::Type::Tuple(_) => "()",
            _ => "",
        };
        self.0.push(sign.to_owned());
        visit::visit_type(self, kind);
    }
}

fn spelling(kind: &syn::Type) -> Spelling {
    let mut spelling = Spelling::default();
    spelling.visit_type(kind);
    spelling
}

/// Returns whether a tuple contains different types. Arguments of closures and items of iterators may be mixed.
fn has_mixed_tuple(kind: &syn::Type) -> bool {
    match kind {
        syn::Type::Tuple(tuple) => {
            let differs = |other| spelling(other) != spelling(&tuple.elems[0]);
            tuple.elems.iter().any(|kind| differs(kind) || has_mixed_tuple(kind))
        }
        syn::Type::Reference(reference) => has_mixed_tuple(&reference.elem),
        syn::Type::Slice(slice) => has_mixed_tuple(&slice.elem),
        syn::Type::Array(array) => has_mixed_tuple(&array.elem),
        syn::Type::Paren(paren) => has_mixed_tuple(&paren.elem),
        syn::Type::Path(_) => contents(kind).into_iter().any(has_mixed_tuple),
        _ => false,
    }
}

#[test]
fn public_functions_return_their_figures() {
    let mut found = Vec::new();
    for function in CRATES.iter().flat_map(|name| functions_of(name)) {
        if parameters(&function.signature).into_iter().any(adds_to_figures) {
            found.push(format!("{}: adds to a figure of its caller; return it", function.place));
        }
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
}

#[test]
fn public_signatures_have_no_mixed_tuples() {
    let mut found = Vec::new();
    for Function { place, signature } in CRATES.iter().flat_map(|name| functions_of(name)) {
        let mut types = parameters(&signature);
        if let syn::ReturnType::Type(_, kind) = &signature.output {
            types.push(kind);
        }
        if types.into_iter().any(has_mixed_tuple) {
            found.push(place);
        }
    }
    // An obsolete exception must leave the list.
    let new: Vec<_> = found.iter().filter(|place| !KNOWN_TUPLES.contains(&place.as_str())).collect();
    let gone: Vec<_> = KNOWN_TUPLES.iter().filter(|known| found.iter().all(|place| place != *known)).collect();
    assert!(new.is_empty() && gone.is_empty(), "mixed tuples: {new:#?}\nexceptions that are none: {gone:#?}");
}
