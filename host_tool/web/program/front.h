// The web server in front of nodal-web: nginx, its site, the site's key and certificate.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "protocol/base/result.h"

namespace nodal::host::web {

/// Where the front's files are.
struct FrontPlaces {
  static constexpr const char *kConf = "/etc/nodal-web", *kNginx = "/etc/nginx", *kAvahi = "/etc/avahi/services";
  std::filesystem::path conf = kConf;    ///< folder of key, certificate and front.json
  std::filesystem::path nginx = kNginx;  ///< folder of nginx.conf, sites-available and sites-enabled

  std::filesystem::path avahi = kAvahi;  ///< folder of services that avahi-daemon announces; it need not be there

  /// systemd's units are asked about the usual places only.
  bool usual() const { return conf == kConf && nginx == kNginx; }
};

/// What front.json says about a front that is enabled.
struct Front {
  std::vector<std::string> names;  ///< names by which browsers reach the page, beside this computer's own
  std::string listen;              ///< address that nginx listens at; empty: all
  std::uint16_t port = 443;
  std::string certificate, key;   ///< files, which an administrator named, or which enable_front() made
  bool made_certificate = false;  ///< by enable_front()
  bool opened_socket = false;     ///< nodal-web.socket was enabled with the front

  /// The page's address for a link, with the first of the names, or the first address of this computer.
  std::string page() const;
};

/// Nothing if no front is enabled. Errors: kBadFormat, kIo.
Result<std::optional<Front>> read_front(const std::filesystem::path& conf);

/// The service of avahi that announces the page at a port: as a rig's, for `nodal rigs`, and as a page.
std::string avahi_service(std::uint16_t port);

/// Makes key and certificate, unless `front` names files of both; front.json; the site; and, where avahi is and nginx
/// listens at all addresses, avahi's service. Asks `nginx -t`, enables nodal-web.socket and lets nginx read its
/// configuration again. After an error nothing of it is left.
/// Returns sentences for people: what listens now, and what is left to do.
/// Errors: kExists for a front that is enabled, or for a file in the way; kBadValue for a name that a site may not
/// have; kNotFound without nginx; kBusy for a port in use; kDeviceFailed with nginx's words; kIo.
Result<std::vector<std::string>> enable_front(const FrontPlaces& places, const std::string& socket, Front front);

/// Removes what enable_front() made, and nothing else. Errors: kNotFound if no front is enabled; kIo.
Result<std::vector<std::string>> disable_front(const FrontPlaces& places);

}  // namespace nodal::host::web
