// A bare page with the player: index.html?src=/kendo-volume/&controls&loop. Each part of the query is an attribute.
import '@v3d/player';

const player = document.createElement('v3d-player');
for (const [name, value] of new URLSearchParams(location.search)) player.setAttribute(name, value);
document.body.append(player);
