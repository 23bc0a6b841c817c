// `web`: the page of a rig on this computer, with nothing on the network.
#include "host_tool/web/web.h"

#include <memory>
#include <mutex>

#include "host_tool/commands/command_list.h"
#include "host_tool/commands/look.h"
#include "protocol/base/try.h"

namespace nodal::host {
namespace {

struct WebArgs {
  bool open = false;
  bool watch = false;
};

Status run_web(Context& context, const WebArgs& args) {
  NODAL_TRY(context.ask([] {
    wire::Request request;
    request.mutable_status();
    return request;
  }()));
  // Pictures, questions and downloads have connections of their own, which several threads open.
  const auto one_at_a_time = std::make_shared<std::mutex>();
  const auto connect = [&context, one_at_a_time] {
    const std::lock_guard lock(*one_at_a_time);
    return context.connect();
  };
  web::Device owner;
  owner.name = "This computer";
  owner.rights = args.watch ? web::Rights::kWatch : web::Rights::kOperate;
  web::Web web(connect, owner);
  ServedPage page{args.open, true, [&](const look::Wanted& wanted) { return web.respond(wanted); }};
  page.started = [&](look::Server* server) { web.set_server(server); };
  page.note = "Open this link in a browser of this computer. Ctrl-C ends it.";
  return serve_page(context, page);
}

}  // namespace

void add_web(CLI::App& app, CommandLine& line) {
  CLI::App* command = add_command(
      app, kWebCommand, "Show the page of a rig on this computer: the live sphere, recording, heads, takes",
      "  nodal web --rig ssh://rig.local --open\n"
      "  nodal web --rig usb: --watch\n"
      "It is the page that nodal-web serves to phones. It prints a link and serves the page, on this computer\n"
      "only, until Ctrl-C; the rig needs no web server, and nothing listens in the network.\n");
  auto args = std::make_shared<WebArgs>();
  command->add_flag("--watch", args->watch, "A page that changes nothing");
  command->add_flag(kOpenFlag, args->open, "Open the page in the browser (xdg-open)");
  line.on(command, [args](Context& context) { return run_web(context, *args); });
}

}  // namespace nodal::host
