#include <cstdio>

#include "hal/linux/link/standard_descriptors.h"
#include "host_tool/commands/command.h"
#include "host_tool/commands/command_list.h"
#include "host_tool/commands/confinement.h"
#include "host_tool/console/console.h"

int main(int argc, char** argv) {
  nodal::hal::guard_standard_descriptors();
  nodal::host::Console console(stdout, stderr);
  nodal::host::CommandLine line(console, nodal::host::add_all_commands);
  line.before_command = nodal::host::confine_command;
  return static_cast<int>(line.run(argc, argv));
}
