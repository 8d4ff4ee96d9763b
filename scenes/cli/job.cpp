#include "job.h"

#include <iostream>
#include <map>

#include "library.h"
#include "print.h"
#include "supple/core/error.h"
#include "supple/core/io/atomic_file.h"
#include "supple/scenes/read_scene.h"
#include "supple/scenes/run.h"

namespace supple::tool {
namespace {

namespace fs = std::filesystem;

const std::map<std::string, scenes::JobFormat>& formats() {
  static const std::map<std::string, scenes::JobFormat> known{
      {"openjd", scenes::JobFormat::OpenJd}, {"slurm", scenes::JobFormat::Slurm}, {"ray", scenes::JobFormat::Ray}};
  return known;
}

/// How to call an engine with a job file.
std::string call_of(scenes::JobFormat format, std::string file) {
  if (file.find(' ') != std::string::npos) file = '"' + file + '"';
  switch (format) {
    case scenes::JobFormat::OpenJd: return "openjd run " + file;
    case scenes::JobFormat::Slurm: return "bash " + file;
    case scenes::JobFormat::Ray: break;
  }
  return "python3 " + file;
}

}  // namespace

CLI::App* add_job(CLI::App& app, JobArguments& a) {
  CLI::App* verb = app.add_subcommand("job", "write a file that runs a scene or a sweep on many machines, by OpenJD, Slurm or Ray");
  verb->add_option("scene", a.scene, "scene file (YAML), or the folder of a sweep")->required();
  verb->add_option("--format", a.format, "openjd, slurm or ray")->required()->check(CLI::IsMember({"openjd", "slurm", "ray"}));
  verb->add_option("--out", a.out, "file to write (default: standard output)");
  verb->add_option("--folder", a.folder, "output folder of the run, which all machines see (default: out/NAME)");
  verb->add_option("--chunk", a.options.chunk, "frames of a task (default: 10)")->check(CLI::Range(1, 1'000'000));
  verb->add_option("--threads", a.options.threads, "threads of a task, and processors that it asks for (default: 4)")->check(CLI::Range(1, 1024));
  verb->add_option("--program", a.options.program, "the tool, as the machines find it (default: supple)");
  verb->add_option("--set", a.set, "override a key in all tasks; may be repeated")->take_all();
  verb->add_option("--allow-path", a.allowed, "file or folder outside the scene's folder that the scene may read; may be repeated")->take_all();
  verb->footer("One task simulates, each further one draws some frames, the last one makes film and sheet. Of a sweep each point is a task, and the last one\n"
               "joins their rows. Tasks may be ended and called again: they do what is missing. They refuse another scene than the one the file was\n"
               "written for.\n\n"
               "Example: supple job scenes/library/contacts/two_balls.yaml --format slurm --chunk 25 --out two_balls.sh && bash two_balls.sh");
  return verb;
}

int write_job(const JobArguments& a) {
  scenes::JobOptions options = a.options;
  options.format = formats().at(a.format);
  const bool sweep = scenes::is_sweep(a.scene);
  if (sweep && !(a.set.empty() && a.allowed.empty() && a.folder.empty())) {
    throw Error(ErrorKind::Usage, Fault{.place = "supple job",
                                        .key = {},
                                        .expected = "expected no --set, --allow-path or --folder for a sweep",
                                        .found = "one",
                                        .hint = "they are parts of its plan"});
  }
  std::string text;
  if (sweep) {
    text = scenes::sweep_job(a.scene, options);
  } else {
    const scenes::Scene scene = scenes::read_scene(find_scene(a.scene), a.set, a.allowed);
    options.folder = a.folder.empty() ? fs::path("out") / scenes::scene_name(scene) : fs::path(a.folder);
    text = scenes::scene_job(scene, options);
  }
  if (a.out.empty()) {
    std::cout << text;
    return 0;
  }
  io::write_atomically(a.out, text);
  print(std::cout, "Wrote %s. Next: %s\n", a.out.c_str(), call_of(options.format, a.out).c_str());
  return 0;
}

}  // namespace supple::tool
