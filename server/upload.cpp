#include "server/upload.h"

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "server/problem.h"
#include "solver/parameters.h"
#include "solver/scene/types.h"

namespace radbake::server {
namespace {

constexpr std::size_t kMostParameters = 65536;
constexpr std::size_t kHead = 64;
constexpr std::size_t kLongestPath = 200;
constexpr std::ptrdiff_t kDeepestPath = 8;
constexpr std::size_t kGlbHeader = 12;

const char* const kGlbName = "scene.glb";
const char* const kGltfName = "scene.gltf";

int HexDigit(char c) {
  constexpr std::string_view kDigits = "0123456789abcdefABCDEF";
  const std::size_t found = kDigits.find(c);
  return found == std::string_view::npos ? -1 : static_cast<int>(found < 16 ? found : found - 6);
}

std::string PercentDecoded(std::string_view text) {
  std::string decoded;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const int high = text[i] == '%' && i + 2 < text.size() ? HexDigit(text[i + 1]) : -1;
    const int low = high >= 0 ? HexDigit(text[i + 2]) : -1;
    decoded += low >= 0 ? static_cast<char>(high * 16 + low) : text[i];
    i += low >= 0 ? 2 : 0;
  }
  return decoded;
}

std::uint32_t ReadUint32(std::string_view bytes, std::size_t offset) {
  std::uint32_t value = 0;
  for (std::size_t i = 4; i-- > 0;) {
    value = (value << 8U) | static_cast<unsigned char>(bytes[offset + i]);
  }
  return value;
}

bool IsGlb(std::string_view head) {
  return head.starts_with("glTF");
}

bool LooksLikeGltf(std::string_view head) {
  constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";
  if (head.starts_with(kByteOrderMark)) {
    head.remove_prefix(kByteOrderMark.size());
  }
  const std::size_t first = head.find_first_not_of(" \t\r\n");
  return first != std::string_view::npos && head[first] == '{';
}

// As far as its header tells; all else is found by the child that reads it.
void CheckScene(std::string_view head, std::uintmax_t size) {
  if (size == 0) {
    throw ProblemError(BadScene("the scene is empty"));
  }
  if (!IsGlb(head)) {
    if (!LooksLikeGltf(head)) {
      throw ProblemError(
          BadScene("the scene is not glTF: it begins neither with \"glTF\" nor with a JSON object"));
    }
    return;
  }
  if (size < kGlbHeader) {
    throw ProblemError(BadScene("the .glb is truncated: it has " + std::to_string(size) + " bytes"));
  }
  if (const std::uint32_t version = ReadUint32(head, 4); version != 2) {
    throw ProblemError(BadScene("the .glb is of version " + std::to_string(version) + ", not 2"));
  }
  if (const std::uint32_t length = ReadUint32(head, 8); length > size) {
    throw ProblemError(BadScene("the .glb is truncated: it says that it has " + std::to_string(length) +
                                " bytes, and has " + std::to_string(size)));
  }
}

}  // namespace

std::string ResourcePath(std::string_view uri) {
  const auto refuse = [&](const char* why) {
    throw ProblemError(
        BadUpload("part " + Quoted(uri) + ": its name is no URI of a file beside the scene: " + why));
  };
  const std::string decoded = PercentDecoded(uri);
  for (const char c : decoded) {
    if (c == '\\' || c == ':' || static_cast<unsigned char>(c) < 0x20 || c == 0x7F) {
      refuse("it has a backslash, a colon or a control character");
    }
  }
  std::string path;
  for (std::size_t begin = 0; begin <= decoded.size();) {
    const std::size_t end = std::min(decoded.find('/', begin), decoded.size());
    const std::string segment = decoded.substr(begin, end - begin);
    if (segment.empty() || segment == "..") {
      refuse("it is absolute, or has an empty segment or \"..\"");
    }
    if (segment != ".") {
      path += (path.empty() ? "" : "/") + segment;
    }
    begin = end + 1;
  }
  if (path.empty()) {
    refuse("it names no file");
  }
  if (path.size() > kLongestPath || std::count(path.begin(), path.end(), '/') >= kDeepestPath) {
    refuse("it is longer than 200 bytes or deeper than 8 folders");
  }
  return path;
}

void Upload::BeginPart(const std::string& name, const std::string& filename) {
  if (++parts_ > most_parts_) {
    throw ProblemError(
        TooLarge("the upload has more than the " + std::to_string(most_parts_) + " parts that are taken"));
  }
  name_ = name;
  filename_ = filename;
  part_digest_.emplace();
  kind_ = name == "scene" ? Kind::kScene : name == "parameters" ? Kind::kParameters : Kind::kResource;
  if ((kind_ == Kind::kScene && has_scene_) || (kind_ == Kind::kParameters && parameters_)) {
    throw ProblemError(BadUpload("there are two parts named " + Quoted(name)));
  }
  if (kind_ == Kind::kParameters) {
    parameters_.emplace();
    return;
  }
  if (kind_ == Kind::kResource) {
    ResourcePath(name);  // refused before a byte of it is taken
  }
  file_.emplace(files_.folder / "part");
}

void Upload::Append(std::string_view bytes) {
  part_digest_->Update(bytes);
  if (kind_ == Kind::kParameters) {
    if (parameters_->size() + bytes.size() > kMostParameters) {
      throw ProblemError(
          TooLarge("the parameters are larger than " + std::to_string(kMostParameters) + " bytes"));
    }
    *parameters_ += bytes;
    return;
  }
  if (kind_ == Kind::kScene) {
    head_ += bytes.substr(0, kHead - std::min(kHead, head_.size()));
    scene_size_ += bytes.size();
  }
  file_->Append(bytes);
}

void Upload::EndPart() {
  digests_.insert(part_digest_->Hex() + Sha256Hex(name_) + Sha256Hex(filename_));
  if (kind_ == Kind::kScene) {
    TakeScene();
  } else if (kind_ == Kind::kResource) {
    TakeResource();
  }
  file_.reset();
  kind_ = Kind::kNone;
}

std::string Upload::Finish() {
  if (!has_scene_) {
    throw ProblemError(BadUpload("there is no part named \"scene\""));
  }
  if (IsGlb(head_) && !first_resource_.empty()) {
    throw ProblemError(BadUpload("part " + Quoted(first_resource_) +
                                 ": a .glb comes alone; only a .gltf has further parts"));
  }
  try {
    ParseParameters(parameters_.value_or("{}"));
  } catch (const InputError& error) {
    throw ProblemError(BadParameters(error.what()));
  }
  NewFile parameters(files_.folder / "part");
  parameters.Append(parameters_.value_or("{}"));
  parameters.Publish(files_.Parameters());
  return SceneFile().lexically_relative(files_.folder).string();
}

std::string Upload::Digest() const {
  Sha256 all;
  for (const std::string& digest : digests_) {
    all.Update(digest);
  }
  return all.Hex();
}

void Upload::TakeScene() {
  CheckScene(head_, scene_size_);
  has_scene_ = true;
  Claim(SceneFile().filename().string());
  file_->Publish(SceneFile());
}

// A resource is found by its part's name and by its filename; which of the two is the URI, only the scene
// knows.
void Upload::TakeResource() {
  const std::string path = ResourcePath(name_);
  Claim(path);
  file_->Publish(files_.Upload() / path);
  first_resource_ = first_resource_.empty() ? name_ : first_resource_;
  if (!filename_.empty()) {
    const std::string other = ResourcePath(filename_);
    if (other != path) {
      Claim(other);
      std::filesystem::create_hard_link(files_.Upload() / path, files_.Upload() / other);
    }
  }
}

// No path twice, and none that is a file here and a folder there.
void Upload::Claim(const std::string& path) {
  bool taken = !paths_.insert(path).second || folders_.contains(path);
  for (std::size_t slash = path.find('/'); slash != std::string::npos; slash = path.find('/', slash + 1)) {
    const std::string folder = path.substr(0, slash);
    taken = taken || paths_.contains(folder);
    folders_.insert(folder);
  }
  if (taken) {
    throw ProblemError(BadUpload("part " + Quoted(name_) + ": another part has the URI " + Quoted(path) +
                                 " or a part of it"));
  }
  std::filesystem::create_directories((files_.Upload() / path).parent_path());
}

std::filesystem::path Upload::SceneFile() const {
  return files_.Upload() / (IsGlb(head_) ? kGlbName : kGltfName);
}

}  // namespace radbake::server
