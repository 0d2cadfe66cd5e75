#include "v3dctl/evaluate/evaluation_page.h"

#include <algorithm>
#include <cstdio>

#include "base/html.h"
#include "base/jpeg.h"
#include "daemon/recorded/frame_colours.h"
#include "daemon/recorded/take_frames.h"
#include "v3dctl/evaluate/evaluation_pictures.h"
#include "v3dctl/options.h"

namespace v3d::ctl {
namespace {

constexpr int kQuality = 88;

std::string number(double value, int digits, const char* unit = "") {
  char text[64];
  std::snprintf(text, sizeof text, "%.*f%s", digits, value, unit);
  return text;
}

/// A row of the table: what it is, and how one column's figure reads.
template <class TextOf>
std::string row(const EvaluationPage& page, const std::string& name, const TextOf& text_of) {
  std::string html = "<tr><td>" + html_escaped(name) + "</td>";
  for (const EvaluatedColumn& column : page.columns) html += "<td>" + text_of(column) + "</td>";
  return html + "</tr>\n";
}

std::string truth_rows(const EvaluationPage& page) {
  const auto of_distance = [&](const char* name, double SurfaceDistance::*figure, int digits) {
    return row(page, name,
               [&](const EvaluatedColumn& c) { return number(c.truth->distance.*figure, digits); });
  };
  // Empty where nothing was of that kind, as of a single frame.
  const auto of_change = [&](const char* name, double SurfaceChange::*part,
                             double SurfaceChange::*figure) {
    const bool any = std::ranges::any_of(
        page.columns, [&](const EvaluatedColumn& c) { return c.truth->change.*part > 0; });
    if (!any) return std::string();
    return row(page, name, [&](const EvaluatedColumn& c) {
      return c.truth->change.*part > 0 ? number(c.truth->change.*figure, 2) : "";
    });
  };
  return of_distance("from the mesh to the truth: half of it within, mm",
                     &SurfaceDistance::accuracy_p50_mm, 2) +
         of_distance("nine tenths within, mm", &SurfaceDistance::accuracy_p90_mm, 1) +
         of_distance("from the truth to the mesh: half within, mm",
                     &SurfaceDistance::completeness_p50_mm, 2) +
         of_distance("nine tenths within, mm", &SurfaceDistance::completeness_p90_mm, 1) +
         of_distance("f-score at 2 mm", &SurfaceDistance::f_score_2mm, 3) +
         of_distance("f-score at 5 mm", &SurfaceDistance::f_score_5mm, 3) +
         of_distance("f-score at 10 mm", &SurfaceDistance::f_score_10mm, 3) +
         of_distance("normals off by, degrees", &SurfaceDistance::normal_error_deg, 1) +
         row(page, "f-score at 5 mm if all were right that two cameras see",
             [](const EvaluatedColumn& c) {
               return number(c.truth->sight.f_score_if_right_from(2), 3);
             }) +
         row(page, "triangles that go through others",
             [](const EvaluatedColumn& c) { return number(c.truth->self_intersections, 0); }) +
         of_change("flicker of what stands still: half within, mm", &SurfaceChange::still,
                   &SurfaceChange::flicker_p50_mm) +
         of_change("nine tenths within, mm", &SurfaceChange::still,
                   &SurfaceChange::flicker_p90_mm) +
         of_change("error of what moves: half within, mm", &SurfaceChange::moving,
                   &SurfaceChange::moving_p50_mm) +
         of_change("nine tenths within, mm", &SurfaceChange::moving, &SurfaceChange::moving_p90_mm);
}

/// Empty without a truth.
std::string true_surface_row(const EvaluationPage& page, size_t camera) {
  const auto reached = [&](const EvaluatedColumn& c) { return c.held_out[camera].true_surface; };
  const auto is_known = [&](const EvaluatedColumn& c) { return reached(c).has_value(); };
  if (std::ranges::none_of(page.columns, is_known)) return "";
  return row(page, page.held_out[camera] + ": PSNR of the true surface, dB",
             [&](const EvaluatedColumn& c) {
               const auto figures = reached(c);
               return figures ? number(figures->psnr_db, 2) : "";
             });
}

std::string held_out_rows(const EvaluationPage& page) {
  std::string html;
  for (size_t i = 0; i < page.held_out.size(); ++i) {
    html += row(page, page.held_out[i] + ": PSNR, dB",
                [&](const EvaluatedColumn& c) { return number(c.held_out[i].inside.psnr_db, 2); }) +
            true_surface_row(page, i) +
            row(page, page.held_out[i] + ": SSIM",
                [&](const EvaluatedColumn& c) { return number(c.held_out[i].inside.ssim, 3); }) +
            row(page, page.held_out[i] + ": silhouette, IoU",
                [&](const EvaluatedColumn& c) { return number(c.held_out[i].iou, 4); });
  }
  return html;
}

std::string table(const EvaluationPage& page) {
  std::string html = "<table><tr><th></th>";
  for (const EvaluatedColumn& column : page.columns) {
    html += "<th>" + html_escaped(column.name) + "</th>";
  }
  html += "</tr>\n";
  if (!page.truth.empty()) html += truth_rows(page);
  return html + held_out_rows(page) + "</table>\n";
}

std::string figure(const Image& picture, const std::string& caption) {
  return "<figure><img alt=\"\" src=\"" + data_url(encode_jpeg(picture.view(), kQuality)) +
         "\"><figcaption>" + html_escaped(caption) + "</figcaption></figure>\n";
}

/// Pictures of equal width in one row.
std::string beside(const std::string& figures) {
  return "<div class=\"beside\">\n" + figures + "</div>\n";
}

std::string error_scale() {
  std::string stops;
  for (const Rgb8& c : kErrorColours) {
    stops += ", rgb(" + std::to_string(c.r) + "," + std::to_string(c.g) + "," +
             std::to_string(c.b) + ")";
  }
  return "<div class=\"scale\" style=\"background: linear-gradient(to right" + stops +
         ")\"></div>\n<div class=\"marks\"><span>0</span><span>" + number(kWorstErrorMm / 2, 0) +
         "</span><span>" + number(kWorstErrorMm, 0, " mm and more") + "</span></div>\n";
}

/// The meshes of the frame that is shown, by column.
std::vector<CompactFrame> meshes_of(const EvaluationPage& page, int64_t frame) {
  std::vector<CompactFrame> meshes;
  for (const EvaluatedColumn& column : page.columns) {
    meshes.push_back(frames_of(column.evaluated).read(frame));
  }
  return meshes;
}

std::string painted_meshes(const EvaluationPage& page, const std::vector<CompactFrame>& meshes,
                           const Mesh& truth) {
  std::string html = "<h2>How far the surface is from the truth</h2>\n" + error_scale();
  for (size_t i = 0; i < meshes.size(); ++i) {
    std::string views;
    for (const Image& view : painted_errors(meshes[i].mesh, truth)) views += figure(view, "");
    html += "<h3>" + html_escaped(page.columns[i].name) + "</h3>\n" + beside(views);
  }
  return html;
}

std::string photograph_and_renderings(const EvaluationPage& page,
                                      const std::vector<CompactFrame>& meshes, size_t camera,
                                      const RigCamera& eye, const SegmentedFrame& frame) {
  const HeldOutPicture picture(eye, frame);
  std::string drawn, apart;
  for (size_t i = 0; i < meshes.size(); ++i) {
    const EvaluatedColumn& column = page.columns[i];
    const Mesh mesh =
        page.view_dependent
            ? FrameColours(column.evaluated.take, meshes[i]).seen_by(eye.model, meshes[i].mesh)
            : meshes[i].mesh;
    drawn += figure(picture.rendering(mesh),
                    column.name + ": " + number(column.held_out[camera].inside.psnr_db, 2, " dB"));
    apart += figure(picture.difference(mesh), column.name + ": difference");
  }
  // The difference stands below its rendering.
  return "<h3>" + html_escaped(page.held_out[camera]) + "</h3>\n" +
         beside(figure(picture.photograph(), "photograph") + drawn) +
         beside("<figure></figure>\n" + apart);
}

std::string held_out_pictures(const EvaluationPage& page, const std::vector<CompactFrame>& meshes,
                              int64_t frame) {
  TakeFrames recorded(page.columns.front().evaluated.take, page.held_out);
  const auto views = recorded.read(frame);
  std::string html =
      "<h2>What cameras saw that took no part</h2>\n<p class=\"note\">Photograph, renderings, and "
      "how far these are apart inside the silhouette: white for 64 grey values and more.</p>\n";
  for (size_t i = 0; i < views.size(); ++i) {
    if (!views[i] || views[i]->mask.count() == 0) continue;
    html += photograph_and_renderings(page, meshes, i, recorded.rig()[i], *views[i]);
  }
  return html;
}

std::string frames_text(const EvaluationPage& page, const std::vector<int64_t>& frames) {
  std::string text = count_of(std::ssize(frames), "frame") + ", pictures of frame " +
                     std::to_string(frames[frames.size() / 2]) + ".";
  if (!page.truth.empty()) text += " Distances are medians over the frames.";
  if (!page.held_out.empty()) text += " Figures of cameras are means over the frames.";
  if (page.view_dependent) text += " Drawn in the colours for the viewpoint of the camera.";
  return text;
}

}  // namespace

std::string evaluation_html(const EvaluationPage& page) {
  const Evaluated& first = page.columns.front().evaluated;
  const std::string name = load_take_info({first.take}).name;
  const std::vector<int64_t> frames = frames_of(first).frames({});
  const int64_t shown = frames[frames.size() / 2];
  const std::vector<CompactFrame> meshes = meshes_of(page, shown);
  std::string html = html_head("Evaluation of " + name) + "<h1>Evaluation of " +
                     html_escaped(name) + "</h1>\n<p>" + frames_text(page, frames) + "</p>\n" +
                     table(page);
  const auto truth = page.truth.empty() ? std::nullopt : read_truth(page.truth, shown);
  if (truth) html += painted_meshes(page, meshes, *truth);
  if (!page.held_out.empty()) html += held_out_pictures(page, meshes, shown);
  return html + "</body></html>\n";
}

}  // namespace v3d::ctl
