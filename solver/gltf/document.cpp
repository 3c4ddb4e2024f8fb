#include "solver/gltf/document.h"

#include <utility>

#include "solver/gltf/export.h"
#include "solver/gltf/file.h"
#include "solver/gltf/import.h"

namespace radbake::gltf {

struct Document::Impl {
  Impl(Source from, const Limits& limits)
      : source(std::move(from)), file(source, limits), imported(Import(file.root, file.layout, limits)) {}

  Source source;
  File file;
  Imported imported;
};

Document::Document(const Source& source, const Limits& limits)
    : impl_(std::make_unique<Impl>(source, limits)) {}
Document::~Document() = default;
Document::Document(Document&&) noexcept = default;
Document& Document::operator=(Document&&) noexcept = default;

const Scene& Document::scene() const {
  return impl_->imported.scene;
}

void Document::SetEnvironment(const Rgb& radiance) {
  impl_->imported.scene.environment = radiance;
}

std::string Document::Export(const BakedScene& baked) const {
  return gltf::Export(impl_->file, impl_->source, impl_->imported, baked);
}

}  // namespace radbake::gltf
