/// Text as HTTP's headers are written.
#pragma once

#include <string>
#include <string_view>

namespace radbake::server {

/// With the letters A to Z as small ones.
std::string Lower(std::string_view text);

/// Without the spaces and tabs at both ends.
std::string_view Trimmed(std::string_view text);

}  // namespace radbake::server
