#include "server/http_assets.h"

#include <array>
#include <utility>

#include "page.css.h"
#include "page.html.h"
#include "page.js.h"
#include "server/digest.h"
#include "server/http_connection.h"
#include "server/http_result.h"
#include "server/openapi.h"
#include "three.h"

namespace radbake::server {
namespace {

// Its own scripts and styles, its own answers, and the images that a .glb carries.
constexpr const char* kPolicy =
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; "
    "connect-src 'self' blob: data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

constexpr std::size_t kTagSize = 16;

Asset MakeAsset(std::string type, std::string bytes, bool page = false) {
  std::string packed = Gzip(bytes);
  std::string tag = Sha256Hex(bytes).substr(0, kTagSize);
  return {std::move(type), std::move(bytes), std::move(packed), std::move(tag), page};
}

std::map<std::string, Asset, std::less<>> MakeAssets() {
  const std::string script = "text/javascript; charset=utf-8";
  std::map<std::string, Asset, std::less<>> assets;
  assets.emplace("/", MakeAsset("text/html; charset=utf-8", kPage, true));
  assets.emplace("/page.css", MakeAsset("text/css; charset=utf-8", kPageStyle));
  assets.emplace("/page.js", MakeAsset(script, kPageScript));
  assets.emplace("/openapi.json", MakeAsset("application/json", OpenApi()));
  for (const auto& [path, text] : kThree) {
    assets.emplace(path, MakeAsset(script, text));
  }
  return assets;
}

}  // namespace

const std::map<std::string, Asset, std::less<>>& Assets() {
  static const std::map<std::string, Asset, std::less<>> kAssets = MakeAssets();
  return kAssets;
}

void SendAsset(const httplib::Request& request, httplib::Response& response, const Asset& asset) {
  const bool gzip = TakesGzip(Header(request, "Accept-Encoding"));
  const std::string tag = "\"" + asset.tag + (gzip ? ".gzip" : "") + "\"";
  response.set_header("ETag", tag);
  response.headers.erase("Cache-Control");
  response.set_header("Cache-Control", "no-cache");
  response.set_header("Vary", "Accept-Encoding");
  if (asset.page) {
    response.set_header("Content-Security-Policy", kPolicy);
    response.set_header("Referrer-Policy", "no-referrer");
  }
  if (HasTag(Header(request, "If-None-Match"), tag)) {
    response.status = 304;
    return;
  }
  response.status = 200;
  if (gzip) {
    response.set_header("Content-Encoding", "gzip");
  }
  response.set_content(gzip ? asset.packed : asset.bytes, asset.type);
}

}  // namespace radbake::server
