#include "host_tool/commands/look.h"

#include <fmt/format.h>
#include <poll.h>

#include "host_tool/commands/command_list.h"
#include "host_tool/commands/envelope_option.h"
#include "host_tool/commands/layout_option.h"
#include "host_tool/console/interrupt.h"
#include "host_tool/console/quantities.h"
#include "host_tool/input/calibration_file.h"
#include "host_tool/input/live_frames.h"
#include "host_tool/input/own_pictures.h"
#include "host_tool/input/rig_pictures.h"
#include "host_tool/input/take_heads.h"
#include "host_tool/look/live_rig.h"
#include "host_tool/look/loopback.h"
#include "host_tool/look/page_files.h"
#include "host_tool/look/server.h"
#include "host_tool/look/sphere.h"
#include "host_tool/look/workbench.h"
#include "protocol/base/try.h"
#include "stitch/geometry/raymap/fisheye_picture.h"

namespace nodal::host {
namespace {

constexpr std::chrono::milliseconds kEndsAfter{60'000};  // after the last page was closed
constexpr int kTickMs = 100;

struct LookArgs {
  std::vector<std::string> inputs;
  std::string from, envelope;
  std::string out = "registered.json";
  bool open = false, heads = false;
  int threads = 0;
};

/// `live`: the raymap that a rig sent first; null: of a file.
Result<std::unique_ptr<look::Sphere>> read_sphere(Console& console, const LookArgs& args,
                                                  const media::Raymap* live = nullptr) {
  look::Sphere::Options options{live != nullptr ? "rig" : args.inputs.front(), args.from, look::usual_envelopes(),
                                args.threads};
  if (live != nullptr) {
    options.film = look::film_of(live->bytes, live->meta.layout);
    options.live = true;
  }
  if (!args.envelope.empty()) {
    NODAL_TRY_ASSIGN(geometry::Envelope own, read_envelope(args.envelope));
    options.envelopes.insert(options.envelopes.begin(), {args.envelope, args.envelope, std::move(own)});
  }
  return interruptible(console, [&] { return look::Sphere::read(options); });
}

/// A take with its calibration, or with one that is given before it.
Result<RigPictures> read_take(const std::vector<std::string>& inputs, std::unique_ptr<TakeHeads>& take) {
  NODAL_TRY_ASSIGN(take, TakeHeads::open(inputs.back()));
  RigPictures rig;
  if (inputs.size() == 1) {
    NODAL_TRY_ASSIGN(rig.calibration, take->calibration());
    return rig;
  }
  NODAL_TRY_ASSIGN(CalibrationFile read, read_calibration_file(inputs.front()));
  rig.calibration = std::move(read.content.calibration);
  rig.notes = std::move(read.content.notes);
  return rig;
}

/// The heads of a calibration with their pictures, which are placed by hand.
Result<std::unique_ptr<look::Workbench>> read_heads(Context& context, const LookArgs& args) {
  Console& console = context.console();
  if (!args.from.empty() || !args.envelope.empty())
    return fail(Errc::kBadValue, "--from and --envelope are for a single sphere, and here are heads");
  look::Workbench::Options options{args.inputs.empty() ? "rig" : args.inputs.front(), args.out, args.threads};
  if (args.inputs.empty() || !context.rig.empty()) {
    options.connect = [&context] { return context.connect(); };
    options.rig = context.rig.empty() ? "the rig" : context.rig;
  }
  RigPictures rig;
  if (args.inputs.empty()) {
    NODAL_TRY_ASSIGN(const std::unique_ptr<RigConnection> connection, context.connect());
    NODAL_TRY_ASSIGN(rig, pull_frame_sets(*connection, "placing heads by hand", 1, console));
    options.gauge = registration::Gauge::kMedian;  // heads that have not moved stay where they are
  }
  return interruptible(console, [&]() -> Result<std::unique_ptr<look::Workbench>> {
    if (args.inputs.size() == 1 && !is_take(args.inputs.front())) {
      return fail(Errc::kBadValue, "--heads: " + args.inputs.front() +
                                       " is no take; give a take, a calibration with a picture of each head, or --rig");
    }
    if (!args.inputs.empty() && args.inputs.size() <= 2 && is_take(args.inputs.back())) {
      NODAL_TRY_ASSIGN(rig, read_take(args.inputs, options.take));
    } else if (!args.inputs.empty()) {
      NODAL_TRY_ASSIGN(rig, read_rig_pictures({}, args.inputs));
    }
    return look::Workbench::make(std::move(rig), std::move(options));
  });
}

/// What answers the page.
struct Shown {
  std::unique_ptr<look::Sphere> sphere;
  std::unique_ptr<look::Workbench> heads;  ///< one of the two
  std::unique_ptr<look::LiveRig> rig;      ///< with a sphere

  look::Answer answer(const look::Wanted& wanted) const {
    if (!wanted.changes) {
      const std::string name = heads != nullptr && wanted.name.empty() ? "heads.html" : wanted.name;
      if (const std::optional<look::Answer> file = look::page_file(name)) return *file;
    }
    if (rig != nullptr && wanted.name == "live") return rig->answer(wanted);
    return heads != nullptr ? heads->answer(wanted) : sphere->answer(wanted);
  }
};

/// A rig by its address.
Result<Shown> watch_rig(Context& context, const LookArgs& args) {
  NODAL_TRY_ASSIGN(const Duration patience, parse_duration(context.timeout));
  Shown shown;
  shown.rig = std::make_unique<look::LiveRig>([&context] { return context.connect(); });
  NODAL_TRY_ASSIGN(const media::Raymap first, shown.rig->first(patience));
  NODAL_TRY_ASSIGN(shown.sphere, read_sphere(context.console(), args, &first));
  return shown;
}

Result<Shown> read_input(Context& context, const LookArgs& args) {
  Console& console = context.console();
  Shown shown;
  if (args.heads || args.inputs.size() > 1) {
    NODAL_TRY_ASSIGN(shown.heads, read_heads(context, args));
    return shown;
  }
  if (args.inputs.empty()) return watch_rig(context, args);
  NODAL_TRY_ASSIGN(shown.sphere, read_sphere(console, args));
  for (const std::string& note : shown.sphere->notes()) console.note("note: " + note);
  return shown;
}

Status run_look(Context& context, const LookArgs& args) {
  NODAL_TRY_ASSIGN(const Shown shown, read_input(context, args));
  ServedPage page{args.open, shown.heads != nullptr, [&](const look::Wanted& wanted) { return shown.answer(wanted); }};
  page.started = [&](look::Server* server) {
    if (shown.rig == nullptr) return;
    shown.rig->on_newer(server == nullptr ? std::function<void()>() : [server] { server->wake(); });
  };
  page.note = "Open this link in a browser of this computer. Ctrl-C ends it, and so does a minute without a page.";
  page.ends_after = kEndsAfter;
  return serve_page(context, page);
}

}  // namespace

Status serve_page(Context& context, const ServedPage& page) {
  Console& console = context.console();
  if (context.page == nullptr) {
    NODAL_TRY_ASSIGN(look::Prepared prepared, look::prepare(page.open));
    context.page = std::make_shared<look::Prepared>(std::move(prepared));
  }
  NODAL_TRY_ASSIGN(const std::string token, look::make_token());
  const look::Rules rules{context.page->loopback.port, token, page.changes};
  NODAL_TRY_ASSIGN(const std::unique_ptr<look::Server> server,
                   look::Server::start(context.page->loopback.socket.get(), rules, page.respond, {}));
  if (page.started) page.started(server.get());
  console.document({{"link", rules.link()}, {"port", rules.port}});
  console.line(rules.link());
  console.note(page.note);
  if (context.page->browser != nullptr) context.page->browser->open(rules.link());
  while (!interrupted() && server->without_page() < page.ends_after && !console.output_gone()) {
    (void)::poll(nullptr, 0, kTickMs);
    server->tick();
  }
  if (page.started) page.started(nullptr);
  return {};
}

Status prepare_look(Context& context, const CLI::App& command) {
  NODAL_TRY_ASSIGN(look::Prepared prepared, look::prepare(command.count(kOpenFlag) > 0));
  context.page = std::make_shared<look::Prepared>(std::move(prepared));
  return {};
}

void add_look(CLI::App& app, CommandLine& line) {
  CLI::App* command = add_command(
      app, kLookCommand,
      "Show a sphere, a film, a take or a running rig in a page of the browser, or place heads by hand",
      "  nodal look sphere.jpg --open\n"
      "  nodal look cube.png --from cube\n"
      "  nodal look hall.jpg --envelope hall.glb\n"
      "  nodal look film.mkv                          a film of raymaps\n"
      "  nodal look 000042                            the raymaps of a take on this computer\n"
      "  nodal look --rig ssh://rig.local             what a running rig films now\n"
      "  nodal look rig.json cam*.jpg -o placed.json  slide the heads' pictures, click pairs, register\n"
      "  nodal look --heads 000042                    the heads of a take, set by set\n"
      "  nodal look --heads --rig ssh://rig.local     a running rig's heads; a result is tried on the rig\n"
      "It prints a link and serves the page, on this computer only, until Ctrl-C or until the last page has\n"
      "been closed for a minute. From another computer: ssh -L PORT:127.0.0.1:PORT, with the link's port.\n");
  auto args = std::make_shared<LookArgs>();
  command
      ->add_option(
          "INPUT", args->inputs,
          "A sphere (JPEG, PNG, TIFF with 8 or 16 bits, HEIF or WebP), a film of JPEGs (.mkv) or the folder of\n"
          "a take; or a calibration and a picture of each head, as for `register`. None: the\n"
          "rig's raymaps")
      ->type_name("");
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
  command->add_option("-o,--out", args->out, "The calibration that the page saves (registered.json when not given)")
      ->type_name("FILE");
  command->add_flag(kHeadsFlag, args->heads,
                    "The heads' own pictures of a take or of a running rig, instead of its raymaps");
  command->add_flag(kOpenFlag, args->open, "Open the page in the browser (xdg-open)");
  command->add_option("--threads", args->threads, "One a core when not given")
      ->type_name("N")
      ->check(CLI::Range(1, 256));
  line.on(command, [args](Context& context) { return run_look(context, *args); });
}

}  // namespace nodal::host
