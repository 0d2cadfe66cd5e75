// Options and output that `v3dctl takes` and its subcommands share.
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "take/take_listing.h"
#include "take/take_removal.h"
#include "v3dctl/command_line.h"

namespace v3d::ctl {

struct TakesArguments {
  std::filesystem::path folder;  ///< of takes; empty: as in the studio file
  std::vector<std::string> names;
  bool json = false;
};
using SharedTakesArguments = std::shared_ptr<TakesArguments>;

std::filesystem::path takes_folder(const CommandLine& line, const TakesArguments& arguments);

/// The takes of the given names. Throws InputError when one does not exist.
std::vector<take::TakeListing> named_takes(const CommandLine& line,
                                           const TakesArguments& arguments);

/// One line for each take, in columns.
std::vector<std::string> listing_lines(const std::vector<take::TakeListing>& takes);
void print_listing(const std::vector<take::TakeListing>& takes, bool json);

/// "the deletion of 2 takes was interrupted: kendo-06, kendo-07".
std::string interrupted_text(const std::vector<take::InterruptedDeletion>& deletions);

/// Each line with printable() (base/core/text.h): names of files of a take may have any bytes.
std::vector<std::string> printable_lines(std::vector<std::string> lines);

/// Adds a subcommand with one example to `takes`.
cli::Command add_takes_subcommand(cli::Command takes, const std::string& name,
                                  const std::string& description, const std::string& example);
void add_names_option(cli::Command command, const SharedTakesArguments& arguments);

// Subcommands, each in the file of its name.
void add_takes_clap(CommandLine& line, cli::Command takes, const SharedTakesArguments& arguments);
void add_takes_collect(CommandLine& line, cli::Command takes,
                       const SharedTakesArguments& arguments);
void add_takes_delete(CommandLine& line, cli::Command takes, const SharedTakesArguments& arguments);

}  // namespace v3d::ctl
