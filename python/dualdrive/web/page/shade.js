// Shaded stretches: every cause has a tint and a hatch of its own, told apart without colours, too.

export const CAUSES = 4;
const TILE = 8; // px
const STROKES = [null, [0, TILE, TILE, 0], [0, 0, TILE, TILE], [TILE / 2, 0, TILE / 2, TILE]];

// The first of the few looks that is still free: who was ticked first keeps his.
export function look(chosen) {
  const taken = new Set(chosen.values());
  for (let k = 0; k < CAUSES; k++) if (!taken.has(k)) return k;
  return chosen.size % CAUSES;
}

// Fills the current path as this cause is filled.
export function shadeAs(ctx, cause, tone) {
  ctx.fillStyle = tone(`shade-${cause}`);
  ctx.fill();
  if (!STROKES[cause]) return;
  ctx.fillStyle = hatch(ctx, STROKES[cause], tone("hatch"));
  ctx.fill();
}

function hatch(ctx, [x0, y0, x1, y1], colour) {
  const tile = document.createElement("canvas");
  tile.width = tile.height = TILE;
  const own = tile.getContext("2d");
  own.strokeStyle = colour;
  for (const over of x0 === x1 ? [0] : [-TILE, 0, TILE]) { // the neighbours' corners
    own.moveTo(x0 + over, y0);
    own.lineTo(x1 + over, y1);
  }
  own.stroke();
  return ctx.createPattern(tile, "repeat");
}
