// nodal-web: the page of a rig for phones, on a Unix socket behind a server that ends TLS; and its devices.
#include <fmt/chrono.h>
#include <fmt/format.h>
#include <poll.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <iostream>
#include <memory>
#include <string>
#include <vector>

#include "hal/linux/link/standard_descriptors.h"
#include "host_tool/console/interrupt.h"
#include "host_tool/look/server.h"
#include "host_tool/rig/rig_address.h"
#include "host_tool/web/devices.h"
#include "host_tool/web/program/certificate.h"
#include "host_tool/web/program/front.h"
#include "host_tool/web/program/listening.h"
#include "host_tool/web/program/own_addresses.h"
#include "host_tool/web/program/qr_text.h"
#include "host_tool/web/web.h"
#include "protocol/base/try.h"
#include "protocol/command_line/plain_help.h"
#include "protocol/command_line/usage.h"

namespace nodal::host::web {
namespace {

constexpr int kExitFailed = 1, kExitUsage = 2;
constexpr int kTickMs = 50;
constexpr Duration kPatience = Duration::seconds(5);
constexpr const char* kStateFolder = "/var/lib/nodal-web";
constexpr const char* kOperateSocket = "unix:/run/nodal/operate.sock";
constexpr const char* kWebSocket = "/run/nodal-web.sock";

constexpr const char* kAbout =
    "The page of a rig for phones and tablets: nodal-web answers a web server in front of it, such as nginx, at a "
    "Unix\n"
    "socket, and talks to nodald at its operate socket. Without a paired device it shows nothing.";
constexpr const char* kFooter =
    "\nExamples:\n"
    "  nodal-web front enable                        nginx ends https for the page; says what listens\n"
    "  nodal-web pair                                a link and a QR code for a phone that operates the rig\n"
    "  nodal-web pair --watch                        for one that only watches\n"
    "  nodal-web devices                             the paired devices\n"
    "  nodal-web revoke 3                            device 3 is refused from now on\n"
    "  nodal-web front disable                       nothing listens\n";

struct Options {
  std::string state = kStateFolder;
  FrontPlaces places;
  Front front;
  std::string socket, rig = kOperateSocket;
  std::vector<std::string> names;
  std::string at;
  bool watch = false;
  std::uint64_t device = 0;
};

/// The names by which this computer is reached: its own, those of the front, and those of the command line.
Result<std::vector<std::string>> names_of(const Options& options) {
  std::vector<std::string> names = own_names();
  NODAL_TRY_ASSIGN(const std::optional<Front> front, read_front(options.places.conf));
  if (front) names.insert(names.end(), front->names.begin(), front->names.end());
  for (const std::string& name : options.names) names.push_back(in_lower_case(name));
  return names;
}

Status serve(const Options& options) {
  NODAL_TRY_ASSIGN(const RigAddress rig, parse_rig_address(options.rig, "ssh"));
  hal::Descriptor own;
  int socket = socket_of_systemd();
  if (socket < 0) {
    NODAL_TRY_ASSIGN(own, listen_at(options.socket));
    socket = own.get();
  }
  watch_interrupts();
  const auto connect = [rig]() -> Result<std::unique_ptr<RigConnection>> {
    auto connection = RigConnection::open(rig, kPatience);
    // Phones show this sentence: nothing in it is about the rig's computer.
    if (!connection) return fail(connection.error().code, "its program, nodald, does not answer this page");
    return connection;
  };
  NODAL_TRY_ASSIGN(std::vector<std::string> names, names_of(options));
  Web web(connect, options.state);
  look::Rules rules;
  rules.changes = true;
  rules.front = look::Front{std::move(names)};
  look::ServerLimits limits;
  limits.pages = 0;  // pages keep no connection open
  limits.connections = Web::kConnections;
  NODAL_TRY_ASSIGN(const std::unique_ptr<look::Server> server,
                   look::Server::start(
                       socket, rules, [&](const look::Wanted& wanted) { return web.respond(wanted); }, limits));
  web.set_server(server.get());
  while (!interrupted()) {
    (void)::poll(nullptr, 0, kTickMs);
    server->tick();
  }
  web.set_server(nullptr);
  return {};
}

Status pair(const Options& options) {
  NODAL_TRY_ASSIGN(const std::optional<Front> front, read_front(options.places.conf));
  if (options.at.empty() && !front)
    return fail(Errc::kBadValue,
                "--at is the address of the page, such as https://192.168.8.1; after `nodal-web front "
                "enable` it is known");
  std::string at = options.at.empty() ? front->page() : options.at;
  if (!at.starts_with("https://") && !at.starts_with("http://127.0.0.1"))
    return fail(Errc::kBadValue, "--at is the address of the page, such as https://192.168.8.1");
  const Rights rights = options.watch ? Rights::kWatch : Rights::kOperate;
  NODAL_TRY_ASSIGN(const std::string code, Devices(options.state).make_code(rights));
  while (at.ends_with('/')) at.pop_back();
  // The code stands in the fragment, which browsers send to nobody: no log, preview or referrer has it.
  const std::string link = fmt::format("{}/pair#{}", at, code);
  if (::isatty(STDOUT_FILENO) == 1) fmt::print("{}\n", qr_text(link));
  fmt::print("{}\n", link);
  fmt::print(stderr, "This link pairs one device that may {} the rig. It is good once, and for ten minutes.\n",
             options.watch ? "watch" : "operate");
  if (!front) return {};
  NODAL_TRY_ASSIGN(const std::string hash, fingerprint_of(front->certificate));
  fmt::print(stderr,
             "SHA-256 of the certificate: {}\n"
             "The phone warns of a certificate that it does not know; where others are in the network, compare this.\n",
             hash);
  return {};
}

Status tell(const Result<std::vector<std::string>>& sentences) {
  if (!sentences) return fail(sentences.error());
  for (const std::string& line : *sentences) fmt::print("{}.\n", line);
  return {};
}

/// The options' names are given in any case, and site and certificate have them in lower case.
Status enable(const Options& options) {
  Front front = options.front;
  for (std::string& name : front.names) name = in_lower_case(name);
  return tell(enable_front(options.places, options.socket.empty() ? kWebSocket : options.socket, std::move(front)));
}

Status list(const Options& options) {
  NODAL_TRY_ASSIGN(const std::vector<Device> devices, Devices(options.state).list());
  for (const Device& device : devices) {
    fmt::print("{:>4}  {:<8} seen {:%Y-%m-%d}  {}\n", device.number, rights_name(device.rights),
               fmt::gmtime(static_cast<std::time_t>(device.seen_s)), device.name);
  }
  if (devices.empty()) fmt::print(stderr, "No device is paired; nodal-web pair makes a link for one.\n");
  return {};
}

void add_front(CLI::App& app, Options& options, Status& done) {
  CLI::App* front = app.add_subcommand("front", "nginx in front of the page: https, limits, its certificate");
  front->require_subcommand(1);
  front->fallthrough();
  front->add_option("--nginx", options.places.nginx, fmt::format("Folder of nginx ({})", FrontPlaces::kNginx))
      ->type_name("DIR");
  front
      ->add_option("--avahi", options.places.avahi,
                   fmt::format("Folder of the services that avahi announces ({})", FrontPlaces::kAvahi))
      ->type_name("DIR");
  CLI::App* enabling = front->add_subcommand("enable", "Make a key, a certificate and a site, and say what listens");
  enabling->add_option("--name", options.front.names, "A name or address by which phones reach it; may be repeated")
      ->type_name("NAME");
  enabling->add_option("--listen", options.front.listen, "The address that nginx listens at; all when not given")
      ->type_name("ADDRESS");
  enabling->add_option("--port", options.front.port, "443 when not given")->type_name("N")->check(CLI::Range(1, 65535));
  enabling->add_option("--certificate", options.front.certificate, "A certificate that phones trust, with --key")
      ->type_name("FILE");
  enabling->add_option("--key", options.front.key, "Its key")->type_name("FILE");
  enabling->add_option("--socket", options.socket, fmt::format("nodal-web's socket ({})", kWebSocket))
      ->type_name("PATH");
  enabling->callback([&] { done = enable(options); });
  CLI::App* disabling = front->add_subcommand("disable", "Remove what `front enable` made, and nothing else");
  disabling->callback([&] { done = tell(disable_front(options.places)); });
}

int run(int argc, char** argv) {
  Options options;
  Status done;
  CLI::App app(kAbout, "nodal-web");
  app.formatter(std::make_shared<PlainHelp>());
  app.footer(kFooter);
  app.set_help_flag("-h,--help", "Print this help and exit");
  app.require_subcommand(1);
  app.fallthrough();
  app.add_option("--state", options.state, fmt::format("Folder of the paired devices ({})", kStateFolder))
      ->type_name("DIR");
  app.add_option("--conf", options.places.conf, fmt::format("Folder of the front's files ({})", FrontPlaces::kConf))
      ->type_name("DIR");
  CLI::App* serving = app.add_subcommand("serve", "Answer requests; the systemd unit runs it");
  serving->add_option("--socket", options.socket, "Unix socket to answer at, if systemd does not open one")
      ->type_name("PATH");
  serving->add_option("--rig", options.rig, fmt::format("The rig ({})", kOperateSocket))->type_name("ADDRESS");
  serving->add_option("--name", options.names, "A name or address of the page beside this computer's; may be repeated")
      ->type_name("NAME");
  serving->callback([&] { done = serve(options); });
  add_front(app, options, done);
  CLI::App* pairing = app.add_subcommand("pair", "Print a link, and a QR code, that pairs one device");
  pairing->add_option("--at", options.at, "Address of the page; that of the front when not given")->type_name("URL");
  pairing->add_flag("--watch", options.watch, "A device that may watch, and change nothing");
  pairing->callback([&] { done = pair(options); });
  app.add_subcommand("devices", "List the paired devices")->callback([&] { done = list(options); });
  CLI::App* revoking = app.add_subcommand("revoke", "Refuse a device from now on");
  revoking->add_option("DEVICE", options.device, "Its number, as `nodal-web devices` prints it")->required();
  revoking->callback([&] { done = Devices(options.state).revoke(options.device); });
  try {
    app.parse(command_words(argc, argv));
  } catch (const CLI::CallForHelp& help) {
    return app.exit(help);
  } catch (const CLI::ParseError& wrong) {
    std::cerr << "nodal-web: " << explain_usage(app, wrong) << '\n' << usage_hint(app) << '\n';
    return kExitUsage;
  }
  if (done) return 0;
  std::cerr << "nodal-web: " << done.error().message << '\n';
  return kExitFailed;
}

}  // namespace
}  // namespace nodal::host::web

int main(int argc, char** argv) {
  nodal::hal::guard_standard_descriptors();
  return nodal::host::web::run(argc, argv);
}
