// nodal-web: the page of a rig for phones, on a Unix socket behind a server that ends TLS; and its devices.
#include <fmt/chrono.h>
#include <fmt/format.h>
#include <poll.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cctype>
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
#include "host_tool/web/program/listening.h"
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

constexpr const char* kAbout =
    "The page of a rig for phones and tablets: nodal-web answers a web server in front of it, such as nginx, at a "
    "Unix\n"
    "socket, and talks to nodald at its operate socket. Without a paired device it shows nothing.";
constexpr const char* kFooter =
    "\nExamples:\n"
    "  nodal-web pair --at https://192.168.8.1       a link and a QR code for a phone that operates the rig\n"
    "  nodal-web pair --at https://rig.local --watch for one that only watches\n"
    "  nodal-web devices                             the paired devices\n"
    "  nodal-web revoke 3                            device 3 is refused from now on\n";

struct Options {
  std::string state = kStateFolder;
  std::string socket, rig = kOperateSocket;
  std::vector<std::string> names;
  std::string at;
  bool watch = false;
  std::uint64_t device = 0;
};

std::string lower(std::string text) {
  std::ranges::transform(text, text.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

/// The names by which this computer is reached: its own, also with .local, and those of the command line.
std::vector<std::string> names_of(const Options& options) {
  std::vector<std::string> names;
  std::string host(256, '\0');
  if (::gethostname(host.data(), host.size() - 1) == 0) {
    host.resize(host.find('\0'));
    names = {lower(host), lower(host) + ".local"};
  }
  for (const std::string& name : options.names) names.push_back(lower(name));
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
  Web web(connect, options.state);
  look::Rules rules;
  rules.changes = true;
  rules.front = look::Front{names_of(options)};
  look::ServerLimits limits;
  limits.pages = 0;          // pages keep no connection open
  limits.connections = 256;  // the server in front limits those of browsers
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
  if (!options.at.starts_with("https://") && !options.at.starts_with("http://127.0.0.1"))
    return fail(Errc::kBadValue, "--at is the address of the page, such as https://192.168.8.1");
  const Rights rights = options.watch ? Rights::kWatch : Rights::kOperate;
  NODAL_TRY_ASSIGN(const std::string code, Devices(options.state).make_code(rights));
  std::string at = options.at;
  while (at.ends_with('/')) at.pop_back();
  // The code stands in the fragment, which browsers send to nobody: no log, preview or referrer has it.
  const std::string link = fmt::format("{}/pair#{}", at, code);
  if (::isatty(STDOUT_FILENO) == 1) fmt::print("{}\n", qr_text(link));
  fmt::print("{}\n", link);
  fmt::print(stderr, "This link pairs one device that may {} the rig. It is good once, and for ten minutes.\n",
             options.watch ? "watch" : "operate");
  return {};
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

int run(int argc, char** argv) {
  Options options;
  CLI::App app(kAbout, "nodal-web");
  app.formatter(std::make_shared<PlainHelp>());
  app.footer(kFooter);
  app.set_help_flag("-h,--help", "Print this help and exit");
  app.require_subcommand(1);
  app.fallthrough();
  app.add_option("--state", options.state, fmt::format("Folder of the paired devices ({})", kStateFolder))
      ->type_name("DIR");
  CLI::App* serving = app.add_subcommand("serve", "Answer requests; the systemd unit runs it");
  serving->add_option("--socket", options.socket, "Unix socket to answer at, if systemd does not open one")
      ->type_name("PATH");
  serving->add_option("--rig", options.rig, fmt::format("The rig ({})", kOperateSocket))->type_name("ADDRESS");
  serving->add_option("--name", options.names, "A name or address of the page beside this computer's; may be repeated")
      ->type_name("NAME");
  CLI::App* pairing = app.add_subcommand("pair", "Print a link, and a QR code, that pairs one device");
  pairing->add_option("--at", options.at, "Address of the page")->type_name("URL")->required();
  pairing->add_flag("--watch", options.watch, "A device that may watch, and change nothing");
  CLI::App* listing = app.add_subcommand("devices", "List the paired devices");
  CLI::App* revoking = app.add_subcommand("revoke", "Refuse a device from now on");
  revoking->add_option("DEVICE", options.device, "Its number, as `nodal-web devices` prints it")->required();
  try {
    app.parse(command_words(argc, argv));
  } catch (const CLI::CallForHelp& help) {
    return app.exit(help);
  } catch (const CLI::ParseError& wrong) {
    std::cerr << "nodal-web: " << explain_usage(app, wrong) << '\n' << usage_hint(app) << '\n';
    return kExitUsage;
  }
  const Status done = serving->parsed()    ? serve(options)
                      : pairing->parsed()  ? pair(options)
                      : listing->parsed()  ? list(options)
                      : revoking->parsed() ? Devices(options.state).revoke(options.device)
                                           : Status();
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
