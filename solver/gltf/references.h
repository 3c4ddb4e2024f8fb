/// Every place where a glTF refers to an accessor or to a buffer view, in one walk: checked on import, and
/// renumbered on export.
#pragma once

#include <functional>
#include <set>
#include <string>

#include "solver/gltf/json.h"

namespace radbake::gltf {

enum class Target { kAccessor, kBufferView };

/// Calls `visit` with each such index of the core format and of the extensions that it knows, in a fixed
/// order. Throws InputError where something on the way there has a wrong type; the indices themselves are not
/// checked.
void ForEachReference(Json& root,
                      const std::function<void(Json& index, Target target, const Place& place)>& visit);
void ForEachReference(const Json& root,
                      const std::function<void(const Json& index, Target target, const Place& place)>& visit);

/// Throws InputError where one of these indices is none, or beyond what there is.
void CheckReferences(const Json& root, std::size_t accessors, std::size_t views);

/// The extensions found anywhere in the document whose members ForEachReference() does not know, and which
/// may therefore refer to accessors and buffer views by themselves.
std::set<std::string> OpaqueExtensions(const Json& root);

}  // namespace radbake::gltf
