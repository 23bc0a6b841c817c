#include "host_tool/commands/look.h"

#include <fmt/format.h>
#include <poll.h>

#include "host_tool/commands/command_list.h"
#include "host_tool/commands/envelope_option.h"
#include "host_tool/commands/layout_option.h"
#include "host_tool/console/interrupt.h"
#include "host_tool/look/loopback.h"
#include "host_tool/look/page_files.h"
#include "host_tool/look/server.h"
#include "host_tool/look/sphere.h"
#include "protocol/base/try.h"
#include "stitch/geometry/raymap/fisheye_picture.h"

namespace nodal::host {
namespace {

constexpr const char* kOpenFlag = "--open";
constexpr std::chrono::milliseconds kEndsAfter{60'000};  // after the last page was closed
constexpr int kTickMs = 100;

struct LookArgs {
  std::string file, from, envelope;
  bool open = false;
  int threads = 0;
};

Result<std::unique_ptr<look::Sphere>> read_sphere(Console& console, const LookArgs& args) {
  look::Sphere::Options options{args.file, args.from, look::usual_envelopes(), args.threads};
  if (!args.envelope.empty()) {
    NODAL_TRY_ASSIGN(geometry::Envelope own, read_envelope(args.envelope));
    options.envelopes.insert(options.envelopes.begin(), {args.envelope, args.envelope, std::move(own)});
  }
  return interruptible(console, [&] { return look::Sphere::read(options); });
}

Status run_look(Context& context, const LookArgs& args) {
  Console& console = context.console();
  NODAL_TRY_ASSIGN(const std::unique_ptr<look::Sphere> sphere, read_sphere(console, args));
  for (const std::string& note : sphere->notes()) console.note("note: " + note);
  if (context.page == nullptr) {
    NODAL_TRY_ASSIGN(look::Prepared prepared, look::prepare(args.open));
    context.page = std::make_shared<look::Prepared>(std::move(prepared));
  }
  NODAL_TRY_ASSIGN(const std::string token, look::make_token());
  const look::Rules rules{context.page->loopback.port, token};
  const auto respond = [&](const look::Wanted& wanted) {
    const std::optional<look::Answer> file = look::page_file(wanted.name);
    return file ? *file : sphere->answer(wanted);
  };
  NODAL_TRY_ASSIGN(const std::unique_ptr<look::Server> server,
                   look::Server::start(context.page->loopback.socket.get(), rules, respond, {}));
  console.document({{"link", rules.link()}, {"port", rules.port}});
  console.line(rules.link());
  console.note("Open this link in a browser of this computer. Ctrl-C ends it, and so does a minute without a page.");
  if (context.page->browser != nullptr) context.page->browser->open(rules.link());
  while (!interrupted() && server->without_page() < kEndsAfter && !console.output_gone()) {
    (void)::poll(nullptr, 0, kTickMs);
    server->tick();
  }
  return {};
}

}  // namespace

Status prepare_look(Context& context, const CLI::App& command) {
  NODAL_TRY_ASSIGN(look::Prepared prepared, look::prepare(command.count(kOpenFlag) > 0));
  context.page = std::make_shared<look::Prepared>(std::move(prepared));
  return {};
}

void add_look(CLI::App& app, CommandLine& line) {
  CLI::App* command = add_command(
      app, kLookCommand, "Show a sphere in a page of this computer's browser; needs no rig",
      "  nodal look sphere.jpg --open\n"
      "  nodal look cube.png --from cube\n"
      "  nodal look hall.jpg --envelope hall.glb\n"
      "It prints a link and serves the page, on this computer only, until Ctrl-C or until the last page has\n"
      "been closed for a minute. From another computer: ssh -L PORT:127.0.0.1:PORT, with the link's port.\n");
  auto args = std::make_shared<LookArgs>();
  command->add_option("SPHERE", args->file, "JPEG, PNG, TIFF (8 or 16 bits), HEIF or WebP")->required()->type_name("");
  command
      ->add_option("--from", args->from,
                   "The file's layout; as its metadata says when not given. Also fisheye:fov=DEGREES and\n"
                   "dual_fisheye:fov=DEGREES, as for `view`")
      ->type_name(layout_type())
      ->check(checked_by([](const std::string& text) -> Status {
        const auto lens = geometry::FisheyePicture::parse(text);
        if (!lens) return check_layout(text);
        return *lens ? Status{} : fail(lens->error());
      }));
  add_envelope_option(*command, args->envelope, "The surface that is shown first (sphere:1 when not given)");
  command->add_flag(kOpenFlag, args->open, "Open the page in the browser (xdg-open)");
  command->add_option("--threads", args->threads, "One a core when not given")
      ->type_name("N")
      ->check(CLI::Range(1, 256));
  line.on(command, [args](Context& context) { return run_look(context, *args); });
}

}  // namespace nodal::host
