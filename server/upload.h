/// The bytes of a POST become the files of a job. Nothing of a client's is used as a path unless it is a
/// plain relative one, and all of it lands in the draft's upload/ folder.
#pragma once

#include <optional>
#include <set>
#include <string>
#include <string_view>

#include "server/digest.h"
#include "server/files.h"
#include "server/jobs.h"

namespace radbake::server {

/// The relative path that a part's name or filename stands for as a URI: percent-decoded, without "."
/// segments. Throws ProblemError (422) for one that is empty, absolute, too long or too deep, or has "..", an
/// empty segment, a backslash, a colon or a control character.
std::string ResourcePath(std::string_view uri);

/// Takes the parts of one upload as they stream by. All functions throw ProblemError for what the client has
/// done wrong, std::system_error for what the disk has.
class Upload {
 public:
  /// At most so many parts are taken.
  Upload(const Draft& draft, int most_parts) : files_(draft.files()), most_parts_(most_parts) {}

  /// The next part: "scene", "parameters", or a resource of a .gltf whose URI is its name or its filename.
  void BeginPart(const std::string& name, const std::string& filename);
  void Append(std::string_view bytes);
  void EndPart();

  /// Checks that the parts fit together: a scene that is a whole .glb or looks like a .gltf, parameters that
  /// can be used (written out, defaults too). Returns the scene's file, relative to the job's folder.
  std::string Finish();

  /// After Finish(): the same for the same parts, whatever their order and whatever stood between them.
  std::string Digest() const;

 private:
  enum class Kind { kNone, kScene, kParameters, kResource };

  void TakeScene();
  void TakeResource();
  void Claim(const std::string& path);
  std::filesystem::path SceneFile() const;

  JobFiles files_;
  Kind kind_ = Kind::kNone;
  int most_parts_;
  int parts_ = 0;
  std::string name_;
  std::string filename_;
  std::optional<NewFile> file_;  ///< of the part that streams by
  std::optional<std::string> parameters_;
  std::string head_;  ///< the first bytes of the scene
  std::uintmax_t scene_size_ = 0;
  bool has_scene_ = false;
  std::string first_resource_;
  std::set<std::string> paths_;
  std::set<std::string> folders_;
  std::optional<Sha256> part_digest_;
  std::set<std::string> digests_;  ///< one a part
};

}  // namespace radbake::server
