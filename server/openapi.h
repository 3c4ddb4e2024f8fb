/// The service's own description.
#pragma once

#include <string>

namespace radbake::server {

/// server/openapi.json with this program's version, and with the parameters as their own table describes
/// them.
std::string OpenApi();

}  // namespace radbake::server
