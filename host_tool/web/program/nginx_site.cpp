#include "host_tool/web/program/nginx_site.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace nodal::host::web {
namespace {

/// Times are between two operations of a client, but client_header_timeout is for the whole header.
constexpr const char* kLimits = R"(  ssl_protocols TLSv1.2 TLSv1.3;
  ssl_session_tickets off;
  server_tokens off;
  client_header_timeout 5s;
  client_body_timeout 5s;
  send_timeout 10s;
  keepalive_timeout 60s;
  client_max_body_size 64k;
  large_client_header_buffers 4 8k;
  limit_conn nodal_web_connections 64;
  limit_conn_status 429;
  limit_req_status 429;
  proxy_http_version 1.1;
  proxy_buffering off;
  proxy_set_header Host $http_host;
  proxy_set_header X-Server-Addr $server_addr;
)";

}  // namespace

std::string nginx_site(const Site& site) {
  std::string text = fmt::format(
      "{}\n"
      "limit_conn_zone $binary_remote_addr zone=nodal_web_connections:1m;\n"
      "limit_req_zone $binary_remote_addr zone=nodal_web_pairs:1m rate=1r/s;\n"
      "server {{\n",
      kSiteMark);
  for (const std::string& at : site.listen) text += fmt::format("  listen {} ssl http2;\n", at);
  const std::string to = fmt::format("proxy_pass http://unix:{}:;", site.socket);
  text += fmt::format("  server_name {};\n  ssl_certificate {};\n  ssl_certificate_key {};\n{}",
                      fmt::join(site.names, " "), site.certificate, site.key, kLimits);
  text += fmt::format(
      "  location / {{ {} }}\n"
      "  location = /api/pair {{ limit_req zone=nodal_web_pairs burst=4 nodelay; {} }}\n"
      "}}\n",
      to, to);
  return text;
}

}  // namespace nodal::host::web
