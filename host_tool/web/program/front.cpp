#include "host_tool/web/program/front.h"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <functional>
#include <nlohmann/json.hpp>

#include "hal/linux/link/descriptor_link.h"
#include "host_tool/child/child.h"
#include "host_tool/child/find_program.h"
#include "host_tool/console/files.h"
#include "host_tool/web/program/certificate.h"
#include "host_tool/web/program/nginx_site.h"
#include "host_tool/web/program/own_addresses.h"
#include "protocol/base/try.h"
#include "protocol/files/open_file.h"
#include "protocol/strict_json.h"

namespace nodal::host::web {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMaxFile = 16 << 10, kMaxNames = 16, kMaxName = 253;
constexpr const char *kSocketUnit = "nodal-web.socket", *kServiceUnit = "nodal-web.service", *kSite = "nodal-web";

struct Files {
  explicit Files(const FrontPlaces& places)
      : front(places.conf / "front.json"),
        key(places.conf / "web.key"),
        certificate(places.conf / "web.crt"),
        site(places.nginx / "sites-available" / kSite),
        enabled(places.nginx / "sites-enabled" / kSite),
        service(places.avahi / "nodal-web.service") {}
  fs::path front, key, certificate, site, enabled, service;
};

tl::unexpected<Error> failed(const fs::path& file, const char* what) {
  const Errc code = errno == EEXIST ? Errc::kExists : Errc::kIo;
  return fail(code, fmt::format("{}: {}: {}", file.string(), what, std::strerror(errno)));
}

/// Files that are made together: those that are there are removed again unless keep() is called.
class Making {
 public:
  ~Making() {
    if (kept_) return;
    for (const fs::path& each : made_) ::unlink(each.c_str());
  }
  Status file(const fs::path& path, const std::string& text, mode_t mode) {
    const mode_t before = ::umask(0077);
    const Result<FilePtr> to = create_to_write(path);
    ::umask(before);
    if (!to) return fail(to.error().in(path.string()));
    made_.push_back(path);
    const bool written = std::fwrite(text.data(), 1, text.size(), to->get()) == text.size() &&
                         std::fflush(to->get()) == 0 && ::fchmod(::fileno(to->get()), mode) == 0 &&
                         ::fsync(::fileno(to->get())) == 0;
    return written ? Status() : failed(path, "cannot be written");
  }
  Status link(const fs::path& target, const fs::path& path) {
    if (::symlink(target.c_str(), path.c_str()) != 0) return failed(path, "cannot be made");
    made_.push_back(path);
    return {};
  }
  void keep() { kept_ = true; }

 private:
  std::vector<fs::path> made_;
  bool kept_ = false;
};

/// Runs a program of the system to its end. Errors: kNotFound; kDeviceFailed with its words.
Status run(const char* name, std::vector<std::string> words) {
  std::string program = find_program(name);
  if (program.empty() && ::access(fmt::format("/usr/sbin/{}", name).c_str(), X_OK) == 0)
    program = fmt::format("/usr/sbin/{}", name);  // not in the path of ordinary users
  if (program.empty()) return fail(Errc::kNotFound, fmt::format("{0} is not installed: apt install {0}", name));
  NODAL_TRY_ASSIGN(const auto child,
                   Child::start({.program = program, .arguments = std::move(words), .writes_files = true}));
  const Child::End end = child->wait();
  if (end.good()) return {};
  return fail(Errc::kDeviceFailed, fmt::format("{} {}", name, end_of(end, child->complaint())));
}

Status check_nginx(const FrontPlaces& places) {
  const Status checked = run("nginx", {"-t", "-q", "-c", (places.nginx / "nginx.conf").string()});
  if (checked || checked.error().code == Errc::kNotFound) return checked;
  return fail(Errc::kDeviceFailed, fmt::format("{}; nothing was changed", checked.error().message));
}

bool has_systemd(const FrontPlaces& places) {
  std::error_code none;
  return places.usual() && fs::is_directory("/run/systemd/system", none);
}

/// What may stand in nginx's configuration without quotation marks.
bool is_plain(const std::string& text, std::string_view marks) {
  return !text.empty() && std::ranges::all_of(text, [&](char c) {
    return std::isalnum(static_cast<unsigned char>(c)) != 0 || marks.find(c) != std::string_view::npos;
  });
}

Status check(const FrontPlaces& places, const std::string& socket, const Front& front) {
  if (front.names.size() > kMaxNames) return fail(Errc::kBadValue, fmt::format("--name: at most {}", kMaxNames));
  for (const std::string& name : front.names) {
    if (name.size() > kMaxName || name.starts_with('-') || (!is_address(name) && !is_plain(name, ".-")))
      return fail(Errc::kBadValue, fmt::format("--name {}: is no name of a host and no address", name));
  }
  if (!front.listen.empty() && !is_address(front.listen))
    return fail(Errc::kBadValue, fmt::format("--listen {}: is no address", front.listen));
  if (front.certificate.empty() != front.key.empty())
    return fail(Errc::kBadValue, "--certificate and --key are given together");
  for (const std::string& path : {places.conf.string(), socket, front.certificate, front.key}) {
    if (!path.empty() && (!path.starts_with('/') || !is_plain(path, "/._-+@")))
      return fail(Errc::kBadValue,
                  fmt::format("{}: an absolute path of letters, digits and / . _ - + @ is needed", path));
  }
  return {};
}

std::string at_port(const std::string& address, std::uint16_t port) {
  return address.find(':') == std::string::npos ? fmt::format("{}:{}", address, port)
                                                : fmt::format("[{}]:{}", address, port);
}

/// Whether the port is free, on the address or on all. nginx itself would say it in its log only.
Status check_port(const Front& front) {
  const bool v6 = front.listen.find(':') != std::string::npos;
  const hal::Descriptor socket(::socket(v6 ? AF_INET6 : AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
  const int on = 1;
  ::setsockopt(socket.get(), SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
  sockaddr_in four{};
  sockaddr_in6 six{};
  four.sin_family = AF_INET;
  six.sin6_family = AF_INET6;
  four.sin_port = six.sin6_port = htons(front.port);
  if (v6) ::inet_pton(AF_INET6, front.listen.c_str(), &six.sin6_addr);
  else if (!front.listen.empty()) ::inet_pton(AF_INET, front.listen.c_str(), &four.sin_addr);
  const auto* const at = v6 ? reinterpret_cast<const sockaddr*>(&six) : reinterpret_cast<const sockaddr*>(&four);
  if (::bind(socket.get(), at, v6 ? sizeof six : sizeof four) == 0) return {};
  if (errno == EADDRINUSE)
    return fail(Errc::kBusy, fmt::format("port {} is in use; --port N takes another", front.port));
  if (errno == EADDRNOTAVAIL)
    return fail(Errc::kBadValue, fmt::format("--listen {}: this computer has no such address", front.listen));
  return {};  // who may not listen there fails where files are made
}

std::vector<std::string> listens(const Front& front) {
  if (!front.listen.empty()) return {at_port(front.listen, front.port)};
  std::vector<std::string> all{std::to_string(front.port)};
  const hal::Descriptor six(::socket(AF_INET6, SOCK_STREAM | SOCK_CLOEXEC, 0));
  if (six.get() >= 0) all.push_back(fmt::format("[::]:{}", front.port));
  return all;
}

std::string front_text(const Front& front) {
  return nlohmann::json{{"names", front.names},
                        {"listen", front.listen},
                        {"port", front.port},
                        {"certificate", front.certificate},
                        {"key", front.key},
                        {"made_certificate", front.made_certificate},
                        {"opened_socket", front.opened_socket}}
             .dump(1) +
         "\n";
}

/// Names of a certificate and a site: the given ones, this computer's, and for a certificate its addresses.
std::vector<std::string> all_names(const Front& front, bool addresses) {
  std::vector<std::string> names;
  const auto add = [&](const std::vector<std::string>& more) {
    for (const std::string& name : more) {
      const bool usable = is_address(name) ? addresses : is_plain(name, ".-");
      if (usable && std::ranges::find(names, name) == names.end()) names.push_back(name);
    }
  };
  add(front.names);
  add(own_names());
  add(front.listen.empty() ? own_addresses() : std::vector{front.listen});
  if (names.empty()) names.emplace_back("localhost");
  return names;
}

/// After the files are in place. What it returns is for people.
Result<std::vector<std::string>> start(const FrontPlaces& places, const std::string& socket, const Front& front) {
  std::vector<std::string> sentences;
  if (has_systemd(places)) {
    NODAL_TRY(run("systemctl", {"enable", "--now", kSocketUnit}));
    NODAL_TRY(run("systemctl", {"try-restart", kServiceUnit}));
    NODAL_TRY(run("systemctl", {"reload-or-restart", "nginx"}));
    sentences.push_back(
        fmt::format("nginx listens at {} with https: {}", fmt::join(listens(front), " and "), front.page()));
    sentences.push_back(fmt::format("nodal-web answers it at {}", socket));
  } else {
    sentences.emplace_back(
        "systemd was not asked. Nothing listens before nginx has read its configuration again (nginx -s "
        "reload) and `nodal-web serve` runs");
    sentences.push_back(fmt::format("nginx then listens at {}: {}", fmt::join(listens(front), " and "), front.page()));
  }
  std::error_code none;
  if (fs::exists(places.nginx / "sites-enabled" / "default", none))
    sentences.push_back(
        fmt::format("nginx's own page listens, too: {}", (places.nginx / "sites-enabled/default").string()));
  NODAL_TRY_ASSIGN(const std::string hash, fingerprint_of(front.certificate));
  sentences.push_back(fmt::format("SHA-256 of the certificate: {}", hash));
  sentences.emplace_back("Pair a phone: nodal-web pair");
  return sentences;
}

}  // namespace

std::string avahi_service(std::uint16_t port) {
  std::string text =
      "<?xml version=\"1.0\" standalone=\"no\"?>\n<!DOCTYPE service-group SYSTEM \"avahi-service.dtd\">\n"
      "<service-group>\n  <name replace-wildcards=\"yes\">Nodal rig on %h</name>\n";
  for (const char* const type : {"_nodal._tcp", "_https._tcp"})
    text += fmt::format("  <service><type>{}</type><port>{}</port></service>\n", type, port);
  return text + "</service-group>\n";
}

std::string Front::page() const {
  std::string host = names.empty() ? listen : names.front();
  if (host.empty()) {
    const std::vector<std::string> addresses = own_addresses();
    host = addresses.empty() ? "127.0.0.1" : addresses.front();
  }
  constexpr std::uint16_t kHttps = 443;
  if (port != kHttps) return fmt::format("https://{}", at_port(host, port));
  return fmt::format("https://{}", host.find(':') == std::string::npos ? host : "[" + host + "]");
}

Result<std::optional<Front>> read_front(const fs::path& conf) {
  const std::string file = (conf / "front.json").string();
  const auto text = read_file(file, kMaxFile);
  if (!text && text.error().code == Errc::kNotFound) return std::nullopt;
  if (!text) return fail(text.error());
  const auto word = JsonShape::value(kMaxFile);
  const auto shape = JsonShape::object({{"names", JsonShape::list(kMaxNames, word)},
                                        {"listen", word},
                                        {"port", word},
                                        {"certificate", word},
                                        {"key", word},
                                        {"made_certificate", word},
                                        {"opened_socket", word}});
  const auto parsed = parse_strict_json(*text, {kMaxFile, 3}, shape);
  if (!parsed) return fail(parsed.error().in(file));
  try {
    return Front{parsed->at("names").get<std::vector<std::string>>(),
                 parsed->at("listen").get<std::string>(),
                 parsed->at("port").get<std::uint16_t>(),
                 parsed->at("certificate").get<std::string>(),
                 parsed->at("key").get<std::string>(),
                 parsed->at("made_certificate").get<bool>(),
                 parsed->at("opened_socket").get<bool>()};
  } catch (const nlohmann::json::exception&) {
    return fail(Errc::kBadFormat, fmt::format("{}: is damaged; nodal-web front disable removes it", file));
  }
}

Result<std::vector<std::string>> enable_front(const FrontPlaces& places, const std::string& socket, Front front) {
  NODAL_TRY(check(places, socket, front));
  const Files files(places);
  std::error_code none;
  if (fs::exists(files.front, none))
    return fail(Errc::kExists,
                fmt::format("{}: the front is enabled; `nodal-web front disable` ends it", files.front.string()));
  NODAL_TRY(check_port(front));
  fs::create_directories(places.conf, none);
  Making making;
  if (front.key.empty()) {
    NODAL_TRY_ASSIGN(const Certificate made, make_certificate(all_names(front, true)));
    front.made_certificate = true;
    front.key = files.key.string();
    front.certificate = files.certificate.string();
    NODAL_TRY(making.file(files.key, made.key, 0600));
    NODAL_TRY(making.file(files.certificate, made.certificate, 0644));
  }
  NODAL_TRY(fingerprint_of(front.certificate));
  front.opened_socket = has_systemd(places) && !run("systemctl", {"is-enabled", "--quiet", kSocketUnit});
  NODAL_TRY(making.file(files.front, front_text(front), 0644));
  const Site site{listens(front), all_names(front, false), front.certificate, front.key, socket};
  NODAL_TRY(making.file(files.site, nginx_site(site), 0644));
  NODAL_TRY(making.link(files.site, files.enabled));
  NODAL_TRY(check_nginx(places));
  const bool announced = front.listen.empty() && fs::is_directory(places.avahi, none);
  if (announced) {
    NODAL_TRY(making.file(files.service, avahi_service(front.port), 0644));
  }
  auto sentences = start(places, socket, front);
  if (!sentences) return sentences;
  if (announced) sentences->emplace_back("avahi, if it runs, announces the page; `nodal rigs` lists it");
  making.keep();
  return sentences;
}

Result<std::vector<std::string>> disable_front(const FrontPlaces& places) {
  const Files files(places);
  const auto front = read_front(places.conf);
  if (front && !*front) return fail(Errc::kNotFound, "no front is enabled");
  const auto site = read_file(files.site.string(), kMaxFile);
  if (site && !site->starts_with(kSiteMark)) {
    return fail(Errc::kExists, fmt::format("{}: was not written by `nodal-web front enable`; it stays, and so does the "
                                           "rest",
                                           files.site.string()));
  }
  std::vector<fs::path> made{files.service, files.enabled, files.site, files.front};
  if (front && (*front)->made_certificate) made.insert(made.end(), {files.key, files.certificate});
  for (const fs::path& each : made) {
    if (::unlink(each.c_str()) != 0 && errno != ENOENT) return failed(each, "cannot be removed");
  }
  ::rmdir(places.conf.c_str());  // stays if there is something else in it
  std::vector<std::string> sentences;
  if (!has_systemd(places)) {
    sentences.emplace_back(
        "The site is removed. systemd was not asked: nginx ends to listen when it reads its configuration "
        "again (nginx -s reload)");
    return sentences;
  }
  if (front && (*front)->opened_socket) {
    NODAL_TRY(run("systemctl", {"disable", "--now", kSocketUnit}));
    NODAL_TRY(run("systemctl", {"stop", kServiceUnit}));
  }
  const Status reloaded = run("systemctl", {"try-reload-or-restart", "nginx"});
  if (!reloaded) return fail(reloaded.error());
  sentences.emplace_back("The page is gone: nginx does not listen for it any more. Paired devices stay paired");
  return sentences;
}

}  // namespace nodal::host::web
