//! Neither the files of a crate nor its folders import each other in cycles.
//!
//! A folder with its `mod.rs` is a room. Within a room, `mod.rs` and the files below it may import from each other. Imports
//! between two files, two rooms, or a file and a room must not form a cycle, at any level.

use super::{CRATES, only_in_tests, root};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use syn::visit::{self, Visit};

/// Path of a module; empty for the crate root.
type Module = Vec<String>;

/// Modules that a file imports, and names that it re-exports.
#[derive(Default)]
struct Imports {
    /// Absolute paths of modules or of their items.
    paths: BTreeSet<Module>,
    /// Names imported by `use`, with their absolute paths.
    names: BTreeMap<String, Module>,
    /// Modules in separate files that exist only in tests.
    test_modules: BTreeSet<Module>,
}

/// Collects the imports of a file.
struct Collector {
    /// Module of the file, and the inline modules around the current item.
    here: Module,
    depth_of_file: usize,
    imports: Imports,
}

impl Collector {
    /// Returns the absolute path if `path` starts with `crate`, `self` or `super`, or, if `in_use`, with a child module.
    fn absolute(&self, path: &[String], in_use: bool) -> Option<Module> {
        // Resolve the first segments to a module.
        let mut base = self.here.clone();
        let mut rest = path;
        match path.first()?.as_str() {
            "crate" => (base, rest) = (Module::new(), &path[1..]),
            "self" => rest = &path[1..],
            "super" => {
                while let [first, others @ ..] = rest
                    && first == "super"
                {
                    base.pop();
                    rest = others;
                }
            }
            _ if in_use => (),
            _ => return None,
        }
        base.extend_from_slice(rest);
        Some(base)
    }

    fn use_tree(&mut self, tree: &syn::UseTree, before: &[String]) {
        let with = |name: &syn::Ident| [before, &[name.to_string()]].concat();
        match tree {
            syn::UseTree::Path(path) => self.use_tree(&path.tree, &with(&path.ident)),
            syn::UseTree::Group(group) => group.items.iter().for_each(|item| self.use_tree(item, before)),
            syn::UseTree::Glob(_) => self.add(before, None),
            syn::UseTree::Name(name) if name.ident == "self" => self.add(before, before.last().cloned()),
            syn::UseTree::Name(name) => self.add(&with(&name.ident), Some(name.ident.to_string())),
            syn::UseTree::Rename(rename) => self.add(&with(&rename.ident), Some(rename.rename.to_string())),
        }
    }

    fn add(&mut self, path: &[String], name: Option<String>) {
        let Some(path) = self.absolute(path, true) else { return };
        // Names in inline modules do not belong to the file.
        if let Some(name) = name.filter(|_| self.here.len() == self.depth_of_file) {
            self.imports.names.insert(name, path.clone());
        }
        self.imports.paths.insert(path);
    }

    /// Collects paths from the tokens of a macro, which is not parsed.
    fn tokens(&mut self, text: &str) {
        let words: Vec<&str> = text.split_whitespace().collect();
        // Extend each `crate` or `super` by the names after `::`.
        for (i, word) in words.iter().enumerate().filter(|(_, word)| ["crate", "super"].contains(word)) {
            let after = words[i + 1..].chunks_exact(2).take_while(|pair| pair[0] == "::");
            let mut path = vec![(*word).to_owned()];
            path.extend(after.map(|pair| pair[1].to_owned()));
            self.imports.paths.extend(self.absolute(&path, false));
        }
    }
}

impl<'ast> Visit<'ast> for Collector {
    fn visit_item_mod(&mut self, module: &'ast syn::ItemMod) {
        self.here.push(module.ident.to_string());
        if !only_in_tests(&module.attrs) {
            visit::visit_item_mod(self, module);
        } else if module.content.is_none() {
            // Record test modules in separate files, because `read` visits these files too.
            self.imports.test_modules.insert(self.here.clone());
        }
        self.here.pop();
    }

    fn visit_item_use(&mut self, item: &'ast syn::ItemUse) {
        if !only_in_tests(&item.attrs) {
            self.use_tree(&item.tree, &[]);
        }
    }

    fn visit_item_fn(&mut self, item: &'ast syn::ItemFn) {
        if !only_in_tests(&item.attrs) {
            visit::visit_item_fn(self, item);
        }
    }

    fn visit_impl_item_fn(&mut self, item: &'ast syn::ImplItemFn) {
        if !only_in_tests(&item.attrs) {
            visit::visit_impl_item_fn(self, item);
        }
    }

    fn visit_path(&mut self, path: &'ast syn::Path) {
        let names: Vec<String> = path.segments.iter().map(|segment| segment.ident.to_string()).collect();
        self.imports.paths.extend(self.absolute(&names, false));
        visit::visit_path(self, path);
    }

    fn visit_macro(&mut self, item: &'ast syn::Macro) {
        self.tokens(&item.tokens.to_string());
    }
}

/// Reads the imports of each file below `folder`, by module.
fn read(folder: &Path, module: &Module, files: &mut BTreeMap<Module, Imports>) {
    for entry in std::fs::read_dir(folder).expect("a folder of sources") {
        let path = entry.expect("an entry").path();
        let name = path.file_stem().expect("a name").to_string_lossy().into_owned();
        let mut own = module.clone();
        // Folders are modules.
        if path.is_dir() {
            own.push(name);
            read(&path, &own, files);
            continue;
        }
        if path.extension().is_none_or(|ending| ending != "rs") {
            continue;
        }
        if !["mod", "lib", "main"].contains(&name.as_str()) {
            own.push(name);
        }
        let source = syn::parse_file(&std::fs::read_to_string(&path).expect("a source")).expect("Rust");
        let mut collector = Collector { depth_of_file: own.len(), here: own.clone(), imports: Imports::default() };
        collector.visit_file(&source);
        // A library and its program share the crate root.
        let Imports { paths, names, test_modules } = collector.imports;
        let imports = files.entry(own).or_default();
        imports.paths.extend(paths);
        imports.names.extend(names);
        imports.test_modules.extend(test_modules);
    }
}

/// Returns the file that defines `path`, following re-exports.
fn defined_in(path: &Module, files: &BTreeMap<Module, Imports>, steps: usize) -> Option<Module> {
    // Find the deepest module of the path that is a file.
    let depth = (0..=path.len()).rev().find(|&depth| files.contains_key(&path[..depth]))?;
    let (module, rest) = path.split_at(depth);
    // Follow a re-export of the next name.
    let handed_on = rest.first().and_then(|name| files[module].names.get(name)).filter(|_| steps > 0);
    let followed = handed_on.and_then(|target| {
        let whole = [target.as_slice(), &rest[1..]].concat();
        defined_in(&whole, files, steps - 1).filter(|found| !found.is_empty())
    });
    followed.or_else(|| Some(module.to_vec()))
}

/// Imports between the files and rooms of one room: importing and imported module, with a description.
type Edges = BTreeMap<(Module, Module), String>;

/// Groups the imports of a crate by room.
fn rooms(files: &BTreeMap<Module, Imports>) -> BTreeMap<Module, Edges> {
    let test_modules: BTreeSet<&Module> = files.values().flat_map(|imports| &imports.test_modules).collect();
    let is_test = |file: &Module| (0..=file.len()).any(|depth| test_modules.contains(&file[..depth].to_vec()));
    let mut rooms = BTreeMap::<Module, Edges>::new();
    for (file, imports) in files.iter().filter(|(file, _)| !is_test(file)) {
        // Compare the modules at the level where their paths diverge.
        for target in imports.paths.iter().filter_map(|path| defined_in(path, files, 8)) {
            let common = file.iter().zip(&target).take_while(|(a, b)| a == b).count();
            if common == file.len() || common == target.len() {
                continue;
            }
            let edge = (file[..=common].to_vec(), target[..=common].to_vec());
            let edges = rooms.entry(file[..common].to_vec()).or_default();
            edges.entry(edge).or_insert_with(|| format!("{} imports {}", file.join("::"), target.join("::")));
        }
    }
    rooms
}

/// Returns whether `to` imports `from`, directly or indirectly.
fn leads_back(edges: &Edges, (from, to): &(Module, Module)) -> bool {
    // Search all modules that `to` imports.
    let (mut reached, mut open) = (BTreeSet::from([to]), vec![to]);
    while let Some(one) = open.pop() {
        let next = edges.keys().filter(|(importing, _)| importing == one).map(|(_, imported)| imported);
        open.extend(next.filter(|&imported| reached.insert(imported)).collect::<Vec<_>>());
    }
    reached.contains(from)
}

/// Describes the imports of a crate that belong to a cycle.
fn circular_imports(name: &str) -> Vec<String> {
    let mut files = BTreeMap::new();
    read(&root().join(name).join("src"), &Module::new(), &mut files);
    assert!(files.len() > 1, "{name} has files");
    let in_room = |edges: Edges| {
        let circular = edges.iter().filter(|(edge, _)| leads_back(&edges, edge));
        circular.map(|(_, words)| format!("{name}: {words}, in a circle")).collect::<Vec<_>>()
    };
    rooms(&files).into_values().flat_map(in_room).collect()
}

#[test]
fn imports_form_no_circles() {
    let circular: Vec<String> = CRATES.iter().chain(&["scenes"]).flat_map(|name| circular_imports(name)).collect();
    assert!(circular.is_empty(), "{}", circular.join("\n"));
}
