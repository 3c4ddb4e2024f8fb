/// SHA-256, as bytes come.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

namespace radbake::server {

class Sha256 {
 public:
  Sha256();
  ~Sha256();
  Sha256(Sha256&&) = delete;

  void Update(std::string_view bytes);
  /// 64 lower-case hexadecimal digits. Once, at the end.
  std::string Hex();

 private:
  struct Context;
  std::unique_ptr<Context> context_;
};

std::string Sha256Hex(std::string_view bytes);

}  // namespace radbake::server
