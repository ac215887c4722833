<?xml version="1.0" encoding="utf-8"?>
<!DOCTYPE TS>
<TS version="2.1" language="de_DE">
<context>
    <name>Actions</name>
    <message>
        <source>&amp;Run this stage</source>
        <translation>Diesen Schritt &amp;ausführen</translation>
    </message>
    <message>
        <source>Do the work of the page that is open.</source>
        <translation>Die Arbeit der offenen Seite ausführen.</translation>
    </message>
    <message>
        <source>&amp;Undo</source>
        <translation>&amp;Rückgängig</translation>
    </message>
    <message>
        <source>Take the last change back, in whichever image it was made.</source>
        <translation>Die letzte Änderung zurücknehmen, in welchem Bild sie auch geschah.</translation>
    </message>
    <message>
        <source>R&amp;edo</source>
        <translation>&amp;Wiederholen</translation>
    </message>
    <message>
        <source>Make the change again that was taken back last.</source>
        <translation>Die zuletzt zurückgenommene Änderung wieder ausführen.</translation>
    </message>
    <message>
        <source>&amp;Cancel the running work</source>
        <translation>Laufende Arbeit ab&amp;brechen</translation>
    </message>
    <message>
        <source>Stop at the next step; nothing half is written.</source>
        <translation>Beim nächsten Schritt anhalten; nichts wird halb geschrieben.</translation>
    </message>
    <message>
        <source>&amp;Full screen</source>
        <translation>&amp;Vollbild</translation>
    </message>
    <message>
        <source>Use the whole screen, or go back to a window.</source>
        <translation>Den ganzen Bildschirm nutzen oder zurück zum Fenster.</translation>
    </message>
    <message>
        <source>&amp;Help beside the work</source>
        <translation>&amp;Hilfe neben der Arbeit</translation>
    </message>
    <message>
        <source>Show or hide the help of the page that is open.</source>
        <translation>Die Hilfe zur offenen Seite zeigen oder verbergen.</translation>
    </message>
    <message>
        <source>&amp;All commands…</source>
        <translation>&amp;Alle Befehle …</translation>
    </message>
    <message>
        <source>Search everything the program can do.</source>
        <translation>Alles durchsuchen, was das Programm kann.</translation>
    </message>
    <message>
        <source>Put all &amp;notices away</source>
        <translation>Alle Hin&amp;weise wegräumen</translation>
    </message>
    <message>
        <source>Clear the notices over the page.</source>
        <translation>Die Hinweise über der Seite wegräumen.</translation>
    </message>
    <message>
        <source>About this &amp;program</source>
        <translation>Über dieses &amp;Programm</translation>
    </message>
    <message>
        <source>Version and licence.</source>
        <translation>Version und Lizenz.</translation>
    </message>
    <message>
        <source>&amp;Quit</source>
        <translation>&amp;Beenden</translation>
    </message>
    <message>
        <source>Close the program; every step is saved already.</source>
        <translation>Das Programm schließen; jeder Schritt ist schon gespeichert.</translation>
    </message>
    <message>
        <source>&amp;Open project…</source>
        <translation>Projekt ö&amp;ffnen …</translation>
    </message>
    <message>
        <source>Go on with a project, or look at captures from another rig.</source>
        <translation>Mit einem Projekt weitermachen oder Aufnahmen eines anderen Aufbaus ansehen.</translation>
    </message>
    <message>
        <source>&amp;Demo experiment…</source>
        <translation>&amp;Vorführversuch …</translation>
    </message>
    <message>
        <source>Let the virtual bench record an experiment, calibrate it and judge it.</source>
        <translation>Den virtuellen Prüfstand einen Versuch aufnehmen, kalibrieren und beurteilen lassen.</translation>
    </message>
    <message>
        <source>Show project &amp;folder</source>
        <translation>Projekt&amp;ordner zeigen</translation>
    </message>
    <message>
        <source>Open the project&apos;s folder in the file manager.</source>
        <translation>Den Ordner des Projekts im Dateimanager öffnen.</translation>
    </message>
    <message>
        <source>&amp;Look for changes</source>
        <translation>Nach Änderungen &amp;sehen</translation>
    </message>
    <message>
        <source>Read the project&apos;s files again.</source>
        <translation>Die Dateien des Projekts neu lesen.</translation>
    </message>
    <message>
        <source>&amp;Close project</source>
        <translation>Projekt s&amp;chließen</translation>
    </message>
    <message>
        <source>Back to the start page; every step is saved already.</source>
        <translation>Zurück zur Startseite; jeder Schritt ist schon gespeichert.</translation>
    </message>
    <message>
        <source>Start page</source>
        <translation>Startseite</translation>
    </message>
    <message>
        <source>The ri&amp;g</source>
        <translation>Der Auf&amp;bau</translation>
    </message>
    <message>
        <source>Open this page.</source>
        <translation>Diese Seite öffnen.</translation>
    </message>
    <message>
        <source>D&amp;ark appearance</source>
        <translation>D&amp;unkle Darstellung</translation>
    </message>
    <message>
        <source>Appearance of the des&amp;ktop</source>
        <translation>Darstellung wie der &amp;Schreibtisch</translation>
    </message>
    <message>
        <source>Everything is up to date.</source>
        <translation>Alles ist auf dem Stand.</translation>
    </message>
    <message>
        <source>Update everything</source>
        <translation>Alles auf den Stand bringen</translation>
    </message>
    <message>
        <source>Switch between light and dark.</source>
        <translation>Zwischen hell und dunkel wechseln.</translation>
    </message>
    <message>
        <source>&amp;Update everything</source>
        <translation>Alles auf den &amp;Stand bringen</translation>
    </message>
    <message>
        <source>Do all that is out of date or to do, in order; what is done stays if it is stopped.</source>
        <translation>Der Reihe nach erledigen, was veraltet oder zu tun ist; was getan ist, bleibt auch beim Abbrechen.</translation>
    </message>
    <message>
        <source>Follow the desktop in light and dark.</source>
        <translation>Hell und dunkel wie die Arbeitsumgebung.</translation>
    </message>
    <message>
        <source>Open a project: the folder with project.json</source>
        <translation>Projekt öffnen: der Ordner mit project.json</translation>
    </message>
    <message>
        <source>Choose a new or empty folder for the demo experiment</source>
        <translation>Einen neuen oder leeren Ordner für den Vorführversuch wählen</translation>
    </message>
    <message>
        <source>The demo experiment is complete; every stage shows its part.</source>
        <translation>Der Vorführversuch ist fertig; jeder Schritt zeigt seinen Teil.</translation>
    </message>
    <message>
        <source>Demo experiment</source>
        <translation>Vorführversuch</translation>
    </message>
    <message>
        <source>&amp;New project…</source>
        <translation>&amp;Neues Projekt …</translation>
    </message>
    <message>
        <source>Describe camera, projector and testfield; begin with an empty project.</source>
        <translation>Kamera, Projektor und Testfeld beschreiben; mit einem leeren Projekt beginnen.</translation>
    </message>
    <message>
        <source>&amp;Print testfield…</source>
        <translation>&amp;Testfeld drucken …</translation>
    </message>
    <message>
        <source>Write the project&apos;s testfield as PDF or SVG at true size.</source>
        <translation>Das Testfeld des Projekts maßhaltig als PDF oder SVG schreiben.</translation>
    </message>
    <message>
        <source>&amp;New capture…</source>
        <translation>&amp;Neue Aufnahme …</translation>
    </message>
    <message>
        <source>Connect projector and camera, check the rig, and record a sequence.</source>
        <translation>Projektor und Kamera verbinden, den Aufbau prüfen und eine Folge aufnehmen.</translation>
    </message>
    <message>
        <source>&amp;Import frames…</source>
        <translation>Bilder &amp;einlesen …</translation>
    </message>
    <message>
        <source>Make a capture of images that another program or projector has made.</source>
        <translation>Aus Bildern eines anderen Programms oder Projektors eine Aufnahme machen.</translation>
    </message>
</context>
<context>
    <name>Background</name>
    <message>
        <source>Measuring {name}</source>
        <translation>Messe {name}</translation>
    </message>
</context>
<context>
    <name>BoardStep</name>
    <message>
        <source>This project has such a board</source>
        <translation>Dieses Projekt hat eine solche Tafel</translation>
    </message>
    <message>
        <source>Rows and columns</source>
        <translation>Zeilen und Spalten</translation>
    </message>
    <message>
        <source>CSV file</source>
        <translation>CSV-Datei</translation>
    </message>
    <message>
        <source>Rows</source>
        <translation>Zeilen</translation>
    </message>
    <message>
        <source>Columns</source>
        <translation>Spalten</translation>
    </message>
    <message>
        <source>Spacing</source>
        <translation>Abstand</translation>
    </message>
    <message>
        <source>Target diameter</source>
        <translation>Markendurchmesser</translation>
    </message>
    <message>
        <source>Targets</source>
        <translation>Zielmarken</translation>
    </message>
    <message>
        <source>white on black</source>
        <translation>weiß auf schwarz</translation>
    </message>
    <message>
        <source>black on white</source>
        <translation>schwarz auf weiß</translation>
    </message>
    <message>
        <source>CSV file with the targets</source>
        <translation>CSV-Datei mit den Zielmarken</translation>
    </message>
    <message>
        <source>Choose…</source>
        <translation>Wählen …</translation>
    </message>
    <message>
        <source>Choose the CSV file</source>
        <translation>Die CSV-Datei wählen</translation>
    </message>
    <message>
        <source>Print this board…</source>
        <translation>Diese Tafel drucken …</translation>
    </message>
    <message>
        <source>No such board in this project.</source>
        <translation>Keine solche Tafel in diesem Projekt.</translation>
    </message>
    <message>
        <source>Choose the targets of the board</source>
        <translation>Die Zielmarken der Tafel wählen</translation>
    </message>
    <message>
        <source>Targets (*.csv);;All files (*)</source>
        <translation>Zielmarken (*.csv);;Alle Dateien (*)</translation>
    </message>
</context>
<context>
    <name>Calibrate</name>
    <message>
        <source>plate at {z:g} mm</source>
        <extracomment>whether it can take part roll_deg, tilt_deg: turn of the board about the viewing axis, and its inclination to the image plane; from the targets measured, else from the picks, and the nominal camera how many were measured last, None before measuring how many an operator excluded what it adds, or why it cannot take part</extracomment>
        <translation>Platte bei {z:g} mm</translation>
    </message>
    <message>
        <source>nothing picked: its targets are told by themselves, if the board allows</source>
        <translation>nichts angewählt: die Marken werden von selbst erkannt, wenn die Tafel es zulässt</translation>
    </message>
    <message>
        <source>the picks do not fit the testfield</source>
        <translation>die angewählten Marken passen nicht zum Testfeld</translation>
    </message>
    <message>
        <source>a quarter turn: A3, A4, x0, y0</source>
        <translation>90°: A3, A4, x0, y0</translation>
    </message>
    <message>
        <source>seen straight on: distortion</source>
        <translation>von vorn: Verzeichnung</translation>
    </message>
    <message>
        <source>inclined: c and the scale in depth</source>
        <translation>geneigt: c, Tiefenmaßstab</translation>
    </message>
    <message>
        <source>{station}, {point}: {x:+.2f} µm in x, {y:+.2f} µm in y</source>
        <translation>{station}, {point}: {x:+.2f} µm in x, {y:+.2f} µm in y</translation>
    </message>
    <message>
        <source>{point}: σ {x:.1f}, {y:.1f}, {z:.1f} µm in X, Y, Z; {n} images</source>
        <translation>{point}: σ {x:.1f}, {y:.1f}, {z:.1f} µm in X, Y, Z; {n} Bilder</translation>
    </message>
</context>
<context>
    <name>CalibrateForm</name>
    <message>
        <source>Method</source>
        <translation>Verfahren</translation>
    </message>
    <message>
        <source>Depth as a function of the phase</source>
        <translation>Tiefe als Funktion der Phase</translation>
    </message>
    <message>
        <source>Low-pass of the depth calibration</source>
        <translation>Tiefpass der Tiefenkalibrierung</translation>
    </message>
    <message>
        <source>Photogrammetric</source>
        <translation>Photogrammetrisch</translation>
    </message>
    <message>
        <source>Polynomial depth</source>
        <translation>Polynom der Tiefe</translation>
    </message>
    <message>
        <source>all, as far as captures allow</source>
        <translation>alle, soweit die Aufnahmen es zulassen</translation>
    </message>
    <message>
        <source>Camera and projector rigidly joined</source>
        <translation>Kamera und Projektor starr</translation>
    </message>
    <message>
        <source>Reject gross errors beyond</source>
        <translation>Grobe Fehler verwerfen über</translation>
    </message>
    <message>
        <source>Limit of gross errors</source>
        <translation>Grenze der groben Fehler</translation>
    </message>
    <message>
        <source>polynomial of degree {n}</source>
        <translation>Polynom vom Grad {n}</translation>
    </message>
    <message>
        <source>table, linear between plates</source>
        <translation>Tabelle, linear zwischen den Platten</translation>
    </message>
    <message>
        <source>none</source>
        <translation>keine</translation>
    </message>
    <message>
        <source>{device}: estimate {name}</source>
        <translation>{device}: {name} schätzen</translation>
    </message>
    <message>
        <source>Camera and projector</source>
        <translation>Kamera und Projektor</translation>
    </message>
    <message>
        <source>Parameters to estimate</source>
        <translation>Zu schätzende Parameter</translation>
    </message>
    <message>
        <source>They can be compared at every plane. Takes as long as all of them together.</source>
        <translation>Sie lassen sich an jeder Ebene vergleichen. Dauert so lange wie alle zusammen.</translation>
    </message>
    <message>
        <source>One relative orientation for all poses: more redundancy. The program tests whether the rig was rigid.</source>
        <translation>Eine relative Orientierung für alle Stellungen: mehr Redundanz. Das Programm prüft, ob der Aufbau starr war.</translation>
    </message>
    <message>
        <source>Every station is oriented on its own: right if the rig was moved or knocked; wider sigmas.</source>
        <translation>Jeder Standpunkt wird für sich orientiert: richtig, wenn der Aufbau bewegt oder gestoßen wurde; größere σ.</translation>
    </message>
    <message>
        <source>Targets that contradict all others are left out one by one and counted; good ones stay.</source>
        <translation>Marken, die allen anderen widersprechen, werden einzeln weggelassen und gezählt; gute bleiben.</translation>
    </message>
    <message>
        <source>Every observation counts; a single wrong target can spoil the result. They are only named.</source>
        <translation>Jede Beobachtung zählt; eine einzige falsche Marke kann das Ergebnis verderben. Sie werden nur genannt.</translation>
    </message>
    <message>
        <source>Passes through every plate position; their noise goes straight into the depth.</source>
        <translation>Geht durch jede Plattenstellung; deren Rauschen geht unmittelbar in die Tiefe ein.</translation>
    </message>
    <message>
        <source>Needs at least {n} plate positions. A higher degree follows the optics more closely and the noise too.</source>
        <translation>Braucht mindestens {n} Plattenstellungen. Ein höherer Grad folgt der Optik genauer, dem Rauschen auch.</translation>
    </message>
    <message>
        <source>The depth of this camera&apos;s pixels follows from this projector&apos;s lines.</source>
        <translation>Die Tiefe der Pixel dieser Kamera folgt aus den Linien dieses Projektors.</translation>
    </message>
    <message>
        <source>Every pixel keeps its own depth curve; its noise stays in the result.</source>
        <translation>Jedes Pixel behält seine eigene Tiefenkurve; ihr Rauschen bleibt im Ergebnis.</translation>
    </message>
    <message>
        <source>Neighbouring pixels are averaged: less noise, and detail finer than this is lost.</source>
        <translation>Benachbarte Pixel werden gemittelt: weniger Rauschen; feinere Einzelheiten gehen verloren.</translation>
    </message>
    <message>
        <source>All are estimated: right where the images are rolled, convergent and filled to the edges.</source>
        <translation>Alle werden geschätzt: richtig, wo die Bilder verkantet, konvergent und bis zum Rand gefüllt sind.</translation>
    </message>
    <message>
        <source>Held: {names}. c stays nominal, others zero; the residuals take what they would explain.</source>
        <translation>Festgehalten: {names}. c bleibt beim Nennwert, die anderen null; was sie erklären würden, geht in die Verbesserungen.</translation>
    </message>
</context>
<context>
    <name>CalibratePage</name>
    <message>
        <source>Calibrate</source>
        <translation>Kalibrieren</translation>
    </message>
    <message>
        <source>Interior and relative orientation of camera and projector, and how well they are known.</source>
        <translation>Innere und relative Orientierung von Kamera und Projektor, und wie genau sie bekannt sind.</translation>
    </message>
    <message>
        <source>Decode, measure and calibrate in the background (F5).</source>
        <translation>Im Hintergrund dekodieren, messen und kalibrieren (F5).</translation>
    </message>
    <message>
        <source>Method</source>
        <translation>Verfahren</translation>
    </message>
    <message>
        <source>Captures</source>
        <translation>Aufnahmen</translation>
    </message>
    <message>
        <source>Run</source>
        <translation>Lauf</translation>
    </message>
    <message>
        <source>Results</source>
        <translation>Ergebnisse</translation>
    </message>
    <message>
        <source>Runs</source>
        <translation>Läufe</translation>
    </message>
    <message>
        <source>Take back</source>
        <translation>Zurücknehmen</translation>
    </message>
    <message>
        <source>Run again</source>
        <translation>Noch einmal rechnen</translation>
    </message>
    <message>
        <source>{method} ({n} captures)</source>
        <translation>{method} ({n} Aufnahmen)</translation>
    </message>
    <message>
        <source>{what}; {options}. Unchanged captures are not measured again.</source>
        <translation>{what}; {options}. Unverändertes wird nicht neu gemessen.</translation>
    </message>
    <message>
        <source>Excluded: {names}.</source>
        <translation>Ausgeschlossen: {names}.</translation>
    </message>
    <message>
        <source>Left out: {names}.</source>
        <translation>Weggelassen: {names}.</translation>
    </message>
    <message>
        <source>Run again to see what that changes.</source>
        <translation>Noch einmal rechnen zeigt, was das ändert.</translation>
    </message>
    <message>
        <source>No calibration yet: {reason}.</source>
        <translation>Noch keine Kalibrierung: {reason}.</translation>
    </message>
    <message>
        <source>This calibration is out of date: {reason}.</source>
        <translation>Diese Kalibrierung ist veraltet: {reason}.</translation>
    </message>
</context>
<context>
    <name>CalibrationResults</name>
    <message>
        <source>Uncertainty over the working volume</source>
        <translation>Unsicherheit über den Arbeitsraum</translation>
    </message>
    <message>
        <source>Results of the calibration</source>
        <translation>Ergebnisse der Kalibrierung</translation>
    </message>
    <message>
        <source>Tables</source>
        <translation>Tabellen</translation>
    </message>
    <message>
        <source>Residuals</source>
        <translation>Verbesserungen</translation>
    </message>
    <message>
        <source>Coverage</source>
        <translation>Abdeckung</translation>
    </message>
    <message>
        <source>Correlations</source>
        <translation>Korrelationen</translation>
    </message>
    <message>
        <source>Object points</source>
        <translation>Punkte</translation>
    </message>
    <message>
        <source>Working volume</source>
        <translation>Arbeitsraum</translation>
    </message>
    <message>
        <source>Captures</source>
        <translation>Aufnahmen</translation>
    </message>
    <message>
        <source>Warnings</source>
        <translation>Warnungen</translation>
    </message>
    <message>
        <source>Warnings ({n})</source>
        <translation>Warnungen ({n})</translation>
    </message>
    <message>
        <source>⚠ {n} warnings: what is weak and what to photograph next, see Warnings.</source>
        <translation>⚠ {n} Warnungen: was schwach ist und was als Nächstes aufzunehmen ist, siehe Warnungen.</translation>
    </message>
    <message>
        <source>⚠ One warning, see Warnings.</source>
        <translation>⚠ Eine Warnung, siehe Warnungen.</translation>
    </message>
    <message>
        <source>Nothing speaks against this calibration.</source>
        <translation>Nichts spricht gegen diese Kalibrierung.</translation>
    </message>
    <message>
        <source>Convergence, weighted sum of squares: {steps}</source>
        <translation>Konvergenz, gewichtete Quadratsumme: {steps}</translation>
    </message>
</context>
<context>
    <name>Capture</name>
    <message>
        <source>testfield</source>
        <translation>Testfeld</translation>
    </message>
    <message>
        <source>plate at a depth</source>
        <translation>Tiefenplatte</translation>
    </message>
    <message>
        <source>plane-table</source>
        <translation>Planplatte</translation>
    </message>
    <message>
        <source>object</source>
        <translation>Objekt</translation>
    </message>
    <message>
        <source>cannot be read</source>
        <translation>nicht lesbar</translation>
    </message>
    <message>
        <source>{n} picks</source>
        <translation>{n} Marken</translation>
    </message>
    <message>
        <source>camera, {w} × {h} px, {c:g} mm</source>
        <translation>Kamera, {w} × {h} px, {c:g} mm</translation>
    </message>
    <message>
        <source>projector, {w} × {h} lines, {c:g} mm</source>
        <translation>Projektor, {w} × {h} Linien, {c:g} mm</translation>
    </message>
</context>
<context>
    <name>CaptureChoice</name>
    <message>
        <source>capture</source>
        <translation>Aufnahme</translation>
    </message>
    <message>
        <source>role</source>
        <translation>Rolle</translation>
    </message>
    <message>
        <source>targets</source>
        <translation>Marken</translation>
    </message>
    <message>
        <source>excluded</source>
        <translation>ausgeschlossen</translation>
    </message>
    <message>
        <source>roll</source>
        <translation>Kantung</translation>
    </message>
    <message>
        <source>tilt</source>
        <translation>Neigung</translation>
    </message>
    <message>
        <source>contributes</source>
        <translation>trägt bei</translation>
    </message>
    <message>
        <source>Captures that take part</source>
        <translation>Beteiligte Aufnahmen</translation>
    </message>
    <message>
        <source>All</source>
        <translation>Alle</translation>
    </message>
    <message>
        <source>Use excluded targets again</source>
        <translation>Ausgeschlossene Marken wieder verwenden</translation>
    </message>
    <message>
        <source>Space or a click on the box leaves a capture out or takes it in.</source>
        <translation>Leertaste oder Klick lässt weg oder nimmt hinzu.</translation>
    </message>
    <message>
        <source>No capture takes part.</source>
        <translation>Keine Aufnahme ist beteiligt.</translation>
    </message>
    <message>
        <source>Take at least {n} captures of the role {role}, or none.</source>
        <translation>Mindestens {n} Aufnahmen der Rolle {role} nehmen, oder keine.</translation>
    </message>
    <message>
        <source>{n} testfields, {r} of them turned by a quarter, and {m} plates take part.</source>
        <translation>{n} Testfelder, {r} davon um 90° gedreht, und {m} Platten sind beteiligt.</translation>
    </message>
</context>
<context>
    <name>CaptureList</name>
    <message>
        <source>Captures</source>
        <translation>Aufnahmen</translation>
    </message>
</context>
<context>
    <name>CapturePage</name>
    <message>
        <source>Capture</source>
        <translation>Aufnehmen</translation>
    </message>
    <message>
        <source>The sequences of stripe images in this project, frame by frame.</source>
        <translation>Die Streifenbildfolgen dieses Projekts, Bild für Bild.</translation>
    </message>
    <message>
        <source>Frames of the capture</source>
        <translation>Bilder der Aufnahme</translation>
    </message>
    <message>
        <source>Frame</source>
        <translation>Bild</translation>
    </message>
    <message>
        <source>This project has no captures yet.</source>
        <translation>Dieses Projekt hat noch keine Aufnahmen.</translation>
    </message>
    <message>
        <source>Brighten</source>
        <translation>Aufhellen</translation>
    </message>
    <message>
        <source>Show up to the brightest pixels of this frame instead of the sensor&apos;s full scale.</source>
        <translation>Bis zum hellsten Pixel dieses Bildes zeigen statt bis zum Vollausschlag des Sensors.</translation>
    </message>
    <message>
        <source>Rig</source>
        <translation>Aufbau</translation>
    </message>
    <message>
        <source>Captures</source>
        <translation>Aufnahmen</translation>
    </message>
    <message>
        <source>Frames</source>
        <translation>Bilder</translation>
    </message>
    <message>
        <source>{w} × {h} px, {bits} bit   mean {mean:.1f}   clipped {clipped:.2f} %</source>
        <translation>{w} × {h} px, {bits} Bit   Mittel {mean:.1f}   übersteuert {clipped:.2f} %</translation>
    </message>
</context>
<context>
    <name>CaptureWizard</name>
    <message>
        <source>New capture</source>
        <translation>Neue Aufnahme</translation>
    </message>
    <message>
        <source>Connect projector and camera, look, and record one sequence of an unmoving scene.</source>
        <translation>Projektor und Kamera verbinden, hinsehen und eine Folge einer unbewegten Szene aufnehmen.</translation>
    </message>
    <message>
        <source>Done</source>
        <translation>Fertig</translation>
    </message>
    <message>
        <source>The projector&apos;s own</source>
        <translation>Die des Projektors</translation>
    </message>
    <message>
        <source>Devices</source>
        <translation>Geräte</translation>
    </message>
    <message>
        <source>What</source>
        <translation>Was</translation>
    </message>
    <message>
        <source>Sequence</source>
        <translation>Folge</translation>
    </message>
    <message>
        <source>Live picture</source>
        <translation>Livebild</translation>
    </message>
    <message>
        <source>Check the rig</source>
        <translation>Aufbau prüfen</translation>
    </message>
    <message>
        <source>Take</source>
        <translation>Aufnehmen</translation>
    </message>
    <message>
        <source>Before and after them {g} more are shown, to see whether anything moved and whether the lamp is steady. The choice is kept in the project.</source>
        <translation>Davor und danach werden {g} weitere gezeigt, um zu sehen, ob sich etwas bewegt hat und ob die Lampe stetig ist. Die Wahl wird im Projekt festgehalten.</translation>
    </message>
</context>
<context>
    <name>Capturing</name>
    <message>
        <source>Virtual bench</source>
        <translation>Virtueller Prüfstand</translation>
    </message>
    <message>
        <source>A simulated rig: nothing to connect, for trying and for training.</source>
        <translation>Ein simulierter Aufbau: nichts anzuschließen, zum Probieren und Üben.</translation>
    </message>
    <message>
        <source>Serial line (RS-232)</source>
        <translation>Serielle Leitung (RS-232)</translation>
    </message>
    <message>
        <source>A projector spoken to by a command profile. Name the port (/dev/ttyUSB0, COM3) and the profile.</source>
        <translation>Ein Projektor, der über ein Befehlsprofil angesprochen wird. Den Anschluss (/dev/ttyUSB0, COM3) und das Profil nennen.</translation>
    </message>
    <message>
        <source>Second screen (HDMI)</source>
        <translation>Zweiter Bildschirm (HDMI)</translation>
    </message>
    <message>
        <source>Any projector that is a screen of this computer, at its own resolution, picture improvements off. Screens: {screens}.</source>
        <translation>Jeder Projektor, der ein Bildschirm dieses Rechners ist, in seiner eigenen Auflösung, Bildverbesserungen aus. Bildschirme: {screens}.</translation>
    </message>
    <message>
        <source>Emulated serial line</source>
        <translation>Nachgebildete serielle Leitung</translation>
    </message>
    <message>
        <source>The virtual bench behind a real serial protocol: for trying profiles, with faults if wanted.</source>
        <translation>Der virtuelle Prüfstand hinter einem echten seriellen Protokoll: um Profile zu erproben, auf Wunsch mit Störungen.</translation>
    </message>
    <message>
        <source>Looks at the same simulated scene as the virtual projector.</source>
        <translation>Sieht dieselbe simulierte Szene wie der virtuelle Projektor.</translation>
    </message>
    <message>
        <source>Video device (USB)</source>
        <translation>Videogerät (USB)</translation>
    </message>
    <message>
        <source>A camera the system knows as a video device, by its number; ?exposure=150&amp;format=GREY set it.</source>
        <translation>Eine Kamera, die das System als Videogerät kennt, nach ihrer Nummer; ?exposure=150&amp;format=GREY stellen sie ein.</translation>
    </message>
    <message>
        <source>Industrial camera (GenICam)</source>
        <translation>Industriekamera (GenICam)</translation>
    </message>
    <message>
        <source>GigE Vision or USB3 Vision: its serial number or 0 for the first, and the maker&apos;s file.</source>
        <translation>GigE Vision oder USB3 Vision: ihre Seriennummer oder 0 für die erste, und die Datei des Herstellers.</translation>
    </message>
    <message>
        <source>Watched folder</source>
        <translation>Überwachter Ordner</translation>
    </message>
    <message>
        <source>Any tethered camera whose own program writes each image into this folder.</source>
        <translation>Jede angeschlossene Kamera, deren eigenes Programm jedes Bild in diesen Ordner schreibt.</translation>
    </message>
    <message>
        <source>Shows a stored capture again: name its folder for projector and camera alike.</source>
        <translation>Zeigt eine gespeicherte Aufnahme noch einmal: ihren Ordner für Projektor und Kamera nennen.</translation>
    </message>
    <message>
        <source>Replay of a capture</source>
        <translation>Wiedergabe einer Aufnahme</translation>
    </message>
    <message>
        <source>Testfield</source>
        <translation>Testfeld</translation>
    </message>
    <message>
        <source>The board of dots in one more pose: about 20, tilted, some turned by 90°.</source>
        <translation>Die Punkttafel in einer weiteren Stellung: etwa 20, geneigt, einige um 90° gedreht.</translation>
    </message>
    <message>
        <source>Plate at a depth</source>
        <translation>Tiefenplatte</translation>
    </message>
    <message>
        <source>A flat plate at a known position along its axis, for the polynomial method.</source>
        <translation>Eine ebene Platte in bekannter Stellung längs ihrer Achse, für das Polynomverfahren.</translation>
    </message>
    <message>
        <source>Plane-table</source>
        <translation>Planplatte</translation>
    </message>
    <message>
        <source>The certified plane at an angle, to judge the calibration.</source>
        <translation>Die zertifizierte Ebene unter einem Winkel, um die Kalibrierung zu beurteilen.</translation>
    </message>
    <message>
        <source>Object</source>
        <translation>Objekt</translation>
    </message>
    <message>
        <source>Whatever is to be measured.</source>
        <translation>Was immer zu messen ist.</translation>
    </message>
    <message>
        <source>{name} answers: {columns} × {rows} lines, waited for {settle:.0f} ms after a pattern.</source>
        <translation>{name} antwortet: {columns} × {rows} Linien, {settle:.0f} ms Wartezeit nach einem Muster.</translation>
    </message>
    <message>
        <source>{name} answers: {width} × {height} px, {bits} bit; an image took {ms:.0f} ms.</source>
        <translation>{name} antwortet: {width} × {height} px, {bits} Bit; ein Bild dauerte {ms:.0f} ms.</translation>
    </message>
    <message>
        <source>Both have the sizes of this project.</source>
        <translation>Beide haben die Größen dieses Projekts.</translation>
    </message>
</context>
<context>
    <name>ChecksStep</name>
    <message>
        <source>Check the rig</source>
        <translation>Aufbau prüfen</translation>
    </message>
    <message>
        <source>Cancel</source>
        <translation>Abbrechen</translation>
    </message>
    <message>
        <source>Worth doing once before the first calibration and after every change of the rig. Put an even, bright surface where measuring will be done.</source>
        <translation>Lohnt sich einmal vor der ersten Kalibrierung und nach jeder Änderung am Aufbau. Eine ebene, helle Fläche dorthin stellen, wo gemessen werden soll.</translation>
    </message>
    <message>
        <source>Findings</source>
        <translation>Befunde</translation>
    </message>
    <message>
        <source>Where the plate stands</source>
        <translation>Wo die Platte steht</translation>
    </message>
    <message>
        <source>Add this depth</source>
        <translation>Diese Tiefe hinzufügen</translation>
    </message>
    <message>
        <source>Takes the finest stripes here; two positions or more show whether the whole depth can be used.</source>
        <translation>Nimmt hier die feinsten Streifen auf; zwei oder mehr Stellungen zeigen, ob die ganze Tiefe nutzbar ist.</translation>
    </message>
    <message>
        <source>Picture of the check</source>
        <translation>Bild der Prüfung</translation>
    </message>
    <message>
        <source>Curve of the check</source>
        <translation>Kurve der Prüfung</translation>
    </message>
    <message>
        <source>Nothing to look at here.</source>
        <translation>Hier gibt es nichts anzusehen.</translation>
    </message>
    <message>
        <source>Working depth: plate at</source>
        <translation>Arbeitstiefe: Platte bei</translation>
    </message>
    <message>
        <source>Checks of the rig</source>
        <translation>Prüfungen des Aufbaus</translation>
    </message>
    <message>
        <source>Stripes</source>
        <translation>Streifen</translation>
    </message>
    <message>
        <source>{good} of {n} checks are good; choose one to see it.</source>
        <translation>{good} von {n} Prüfungen sind gut; eine wählen, um sie zu sehen.</translation>
    </message>
    <message>
        <source>Stripes taken at one depth; put the plate elsewhere and add that depth too.</source>
        <translation>Streifen in einer Tiefe aufgenommen; die Platte anderswohin stellen und auch diese Tiefe hinzufügen.</translation>
    </message>
    <message>
        <source>The checks could not be done.</source>
        <translation>Die Prüfungen ließen sich nicht ausführen.</translation>
    </message>
    <message>
        <source>Stopped.</source>
        <translation>Angehalten.</translation>
    </message>
</context>
<context>
    <name>ColourBar</name>
    <message>
        <source>Colour scale from {a:g} to {b:g} {unit}</source>
        <translation>Farbskala von {a:g} bis {b:g} {unit}</translation>
    </message>
</context>
<context>
    <name>CommandPalette</name>
    <message>
        <source>Commands</source>
        <translation>Befehle</translation>
    </message>
    <message>
        <source>Search all commands</source>
        <translation>Alle Befehle durchsuchen</translation>
    </message>
    <message>
        <source>Commands found</source>
        <translation>Gefundene Befehle</translation>
    </message>
</context>
<context>
    <name>ConvergencePlot</name>
    <message>
        <source>Convergence</source>
        <translation>Konvergenz</translation>
    </message>
    <message>
        <source>iteration</source>
        <translation>Iteration</translation>
    </message>
    <message>
        <source>σ0, correction</source>
        <translation>σ0, Zuschlag</translation>
    </message>
    <message>
        <source>correction</source>
        <translation>Zuschlag</translation>
    </message>
    <message>
        <source>The iterations are drawn here while they run.</source>
        <translation>Die Iterationen werden hier gezeichnet, während sie laufen.</translation>
    </message>
    <message>
        <source>After {n} iterations: σ0 {s:.4g}</source>
        <translation>Nach {n} Iterationen: σ0 {s:.4g}</translation>
    </message>
    <message>
        <source>; the last correction was {c:.2g} σ, all unknowns together.</source>
        <translation>; der letzte Zuschlag war {c:.2g} σ, alle Unbekannten zusammen.</translation>
    </message>
    <message>
        <source> Begun anew {n} times: after gross errors, for the weights, to test the rig.</source>
        <translation> {n}-mal neu begonnen: nach groben Fehlern, für die Gewichte, um den Aufbau zu prüfen.</translation>
    </message>
</context>
<context>
    <name>CorrelationView</name>
    <message>
        <source>Correlations</source>
        <translation>Korrelationen</translation>
    </message>
    <message>
        <source>Correlation under the cursor</source>
        <translation>Korrelation unter dem Zeiger</translation>
    </message>
    <message>
        <source>Strongest correlations</source>
        <translation>Stärkste Korrelationen</translation>
    </message>
    <message>
        <source>parameter</source>
        <translation>Parameter</translation>
    </message>
    <message>
        <source>with</source>
        <translation>mit</translation>
    </message>
    <message>
        <source>correlation</source>
        <translation>Korrelation</translation>
    </message>
    <message>
        <source>Strongest pairs</source>
        <translation>Stärkste Paare</translation>
    </message>
    <message>
        <source>Point at a cell to read it, or use the arrow keys. A dot marks correlations beyond ±0.9.</source>
        <translation>Auf eine Zelle zeigen (oder Pfeiltasten), um sie zu lesen. Punkt: über ±0.9.</translation>
    </message>
</context>
<context>
    <name>CoverageView</name>
    <message>
        <source>Points of all stations per cell of the image. Where there are none the additional parameters are extrapolated: fill edges and corners.</source>
        <translation>Punkte aller Standpunkte je Zelle des Bildes. Wo keine sind, werden die zusätzlichen Parameter extrapoliert: Ränder und Ecken füllen.</translation>
    </message>
    <message>
        <source>Coverage of {name}</source>
        <translation>Abdeckung von {name}</translation>
    </message>
    <message>
        <source>{n} points; hull {h:.0%} of the image; {c:.0%} of the cells hold points</source>
        <translation>{n} Punkte; Hülle {h:.0%} des Bildes; {c:.0%} der Zellen enthalten Punkte</translation>
    </message>
</context>
<context>
    <name>CrossValidation</name>
    <message>
        <source>Leaves each capture out in turn and tests whether the others predict what it shows.</source>
        <translation>Lässt jede Aufnahme einmal weg und prüft, ob die anderen voraussagen, was sie zeigt.</translation>
    </message>
    <message>
        <source>Cross-validation</source>
        <translation>Kreuzvalidierung</translation>
    </message>
    <message>
        <source>Leave each out</source>
        <translation>Jede weglassen</translation>
    </message>
    <message>
        <source>captures against each other</source>
        <translation>Aufnahmen gegeneinander</translation>
    </message>
</context>
<context>
    <name>Decode</name>
    <message>
        <source>Projector u (columns)</source>
        <translation>Projektor u (Spalten)</translation>
    </message>
    <message>
        <source>Projector v (rows)</source>
        <translation>Projektor v (Zeilen)</translation>
    </message>
    <message>
        <source>Modulation</source>
        <translation>Modulation</translation>
    </message>
    <message>
        <source>σ of u</source>
        <translation>σ von u</translation>
    </message>
    <message>
        <source>σ of v</source>
        <translation>σ von v</translation>
    </message>
    <message>
        <source>Evenly lit image</source>
        <translation>Gleichmäßig beleuchtetes Bild</translation>
    </message>
    <message>
        <source>Validity</source>
        <translation>Gültigkeit</translation>
    </message>
    <message>
        <source>lines</source>
        <translation>Linien</translation>
    </message>
    <message>
        <source>grey</source>
        <translation>Grauwerte</translation>
    </message>
    <message>
        <source>invalid: {why}</source>
        <translation>ungültig: {why}</translation>
    </message>
    <message>
        <source>low modulation</source>
        <translation>schwache Modulation</translation>
    </message>
    <message>
        <source>saturated</source>
        <translation>gesättigt</translation>
    </message>
    <message>
        <source>unsure</source>
        <translation>unsicher</translation>
    </message>
    <message>
        <source>disagreement</source>
        <translation>Widerspruch</translation>
    </message>
    <message>
        <source>outside</source>
        <translation>außerhalb</translation>
    </message>
    <message>
        <source>lit from beside</source>
        <translation>Licht von nebenan</translation>
    </message>
    <message>
        <source>no u</source>
        <translation>kein u</translation>
    </message>
    <message>
        <source>no v</source>
        <translation>kein v</translation>
    </message>
    <message>
        <source>{axis} valid [%]</source>
        <translation>{axis} gültig [%]</translation>
    </message>
    <message>
        <source>σ of {axis}, median [lines]</source>
        <translation>σ von {axis}, Median [Linien]</translation>
    </message>
    <message>
        <source>modulation, median [grey]</source>
        <translation>Modulation, Median [Grau]</translation>
    </message>
    <message>
        <source>quantity</source>
        <translation>Größe</translation>
    </message>
    <message>
        <source>value</source>
        <translation>Wert</translation>
    </message>
</context>
<context>
    <name>DecodePage</name>
    <message>
        <source>Decode</source>
        <translation>Dekodieren</translation>
    </message>
    <message>
        <source>Which projector line lit each pixel, how surely, and where that cannot be told.</source>
        <translation>Welche Projektorlinie jedes Pixel beleuchtet hat, wie sicher, und wo sich das nicht sagen lässt.</translation>
    </message>
    <message>
        <source>Map of the decoded capture</source>
        <translation>Karte der dekodierten Aufnahme</translation>
    </message>
    <message>
        <source>Figures of the decoded capture</source>
        <translation>Zahlen der dekodierten Aufnahme</translation>
    </message>
    <message>
        <source>Decode all captures</source>
        <translation>Alle Aufnahmen dekodieren</translation>
    </message>
    <message>
        <source>Decode every capture that has changed, and keep its figures (F5).</source>
        <translation>Jede geänderte Aufnahme dekodieren und ihre Zahlen behalten (F5).</translation>
    </message>
    <message>
        <source>Figures</source>
        <translation>Zahlen</translation>
    </message>
    <message>
        <source>This project has no captures yet.</source>
        <translation>Dieses Projekt hat noch keine Aufnahmen.</translation>
    </message>
    <message>
        <source>{n} captures decoded.</source>
        <translation>{n} Aufnahmen dekodiert.</translation>
    </message>
    <message>
        <source>decoding …</source>
        <translation>dekodiere …</translation>
    </message>
</context>
<context>
    <name>DeviationMaps</name>
    <message>
        <source>Move the mouse over a map, or Shift and the arrow keys, to read values.</source>
        <translation>Werte lesen: mit der Maus über eine Karte, oder Umschalt und Pfeiltasten.</translation>
    </message>
    <message>
        <source>End of the colour scale</source>
        <translation>Ende der Farbskala</translation>
    </message>
    <message>
        <source>Automatic</source>
        <translation>Automatisch</translation>
    </message>
    <message>
        <source>Three times the largest r.m.s., as in the report.</source>
        <translation>Dreimal das größte r.m.s., wie im Bericht.</translation>
    </message>
    <message>
        <source>Deviations are positive towards the camera.</source>
        <translation>Abweichungen sind zur Kamera hin positiv.</translation>
    </message>
    <message>
        <source>+ is towards the camera</source>
        <translation>+ ist zur Kamera hin</translation>
    </message>
    <message>
        <source>Whole planes</source>
        <translation>Ganze Ebenen</translation>
    </message>
    <message>
        <source>Scale</source>
        <translation>Skala</translation>
    </message>
    <message>
        <source>Values under the cursor</source>
        <translation>Werte unter dem Zeiger</translation>
    </message>
    <message>
        <source>Deviations of {capture}, {method}</source>
        <translation>Abweichungen von {capture}, {method}</translation>
    </message>
    <message>
        <source>Shift and the arrow keys move the cursor; plus and minus zoom, the arrow keys move the map.</source>
        <translation>Umschalt und die Pfeiltasten bewegen den Zeiger; Plus und Minus vergrößern und verkleinern, die Pfeiltasten verschieben die Karte.</translation>
    </message>
    <message>
        <source>{rms} mm r.m.s.</source>
        <translation>{rms} mm r.m.s.</translation>
    </message>
    <message>
        <source>{n} points</source>
        <translation>{n} Punkte</translation>
    </message>
</context>
<context>
    <name>DeviceCard</name>
    <message>
        <source>{device}: kind</source>
        <translation>{device}: Art</translation>
    </message>
    <message>
        <source>{device}: address</source>
        <translation>{device}: Adresse</translation>
    </message>
</context>
<context>
    <name>DevicesStep</name>
    <message>
        <source>Projector</source>
        <translation>Projektor</translation>
    </message>
    <message>
        <source>Camera</source>
        <translation>Kamera</translation>
    </message>
    <message>
        <source>What stands before the virtual rig</source>
        <translation>Was vor dem virtuellen Aufbau steht</translation>
    </message>
    <message>
        <source>Before the virtual rig stands</source>
        <translation>Vor dem virtuellen Aufbau steht</translation>
    </message>
    <message>
        <source>of its experiment.</source>
        <translation>aus seinem Versuch.</translation>
    </message>
    <message>
        <source>Test the connection</source>
        <translation>Verbindung prüfen</translation>
    </message>
    <message>
        <source>Connection</source>
        <translation>Verbindung</translation>
    </message>
    <message>
        <source>Test the connection first.</source>
        <translation>Zuerst die Verbindung prüfen.</translation>
    </message>
    <message>
        <source>At its very first use the virtual bench is compiled, which can take a minute.</source>
        <translation>Beim allerersten Gebrauch wird der virtuelle Prüfstand übersetzt, was eine Minute dauern kann.</translation>
    </message>
    <message>
        <source>Asking both devices …</source>
        <translation>Frage beide Geräte …</translation>
    </message>
    <message>
        <source>Connection test</source>
        <translation>Verbindungsprüfung</translation>
    </message>
    <message>
        <source>Not tested yet.</source>
        <translation>Noch nicht geprüft.</translation>
    </message>
</context>
<context>
    <name>Evaluate</name>
    <message>
        <source>no value</source>
        <translation>kein Wert</translation>
    </message>
    <message>
        <source>{method}: no values</source>
        <translation>{method}: keine Werte</translation>
    </message>
    <message>
        <source>{method}: {rms:.1f} µm r.m.s., {low:+.0f} to {high:+.0f} µm</source>
        <translation>{method}: {rms:.1f} µm r.m.s., {low:+.0f} bis {high:+.0f} µm</translation>
    </message>
    <message>
        <source>{method}: within 1, 2, 3 r.m.s. {shares} % (normal {normal} %); r.m.s. {rms} mm{predicted}</source>
        <translation>{method}: innerhalb von 1, 2, 3 r.m.s. {shares} % (normal {normal} %); r.m.s. {rms} mm{predicted}</translation>
    </message>
    <message>
        <source>, from the noise {rms} mm</source>
        <translation>, aus dem Rauschen {rms} mm</translation>
    </message>
</context>
<context>
    <name>EvaluatePage</name>
    <message>
        <source>Evaluate</source>
        <translation>Beurteilen</translation>
    </message>
    <message>
        <source>How far the points of the plane-table lie from the plane fitted to them.</source>
        <translation>Wie weit die Punkte der Planplatte von der ausgeglichenen Ebene abliegen.</translation>
    </message>
    <message>
        <source>Deviations from the plane-table</source>
        <translation>Abweichungen von der Planplatte</translation>
    </message>
    <message>
        <source>Maps</source>
        <translation>Karten</translation>
    </message>
    <message>
        <source>Judge the ticked planes by the ticked calibrations (F5).</source>
        <translation>Die angekreuzten Ebenen mit den angekreuzten Kalibrierungen beurteilen (F5).</translation>
    </message>
    <message>
        <source>Planes</source>
        <translation>Ebenen</translation>
    </message>
    <message>
        <source>Calibrations</source>
        <translation>Kalibrierungen</translation>
    </message>
    <message>
        <source>Choose</source>
        <translation>Wählen</translation>
    </message>
    <message>
        <source>Profile</source>
        <translation>Profil</translation>
    </message>
    <message>
        <source>Histogram</source>
        <translation>Histogramm</translation>
    </message>
    <message>
        <source>Table 3</source>
        <translation>Tabelle 3</translation>
    </message>
    <message>
        <source>Planes evaluated: {n}.</source>
        <translation>Beurteilte Ebenen: {n}.</translation>
    </message>
    <message>
        <source>{n} planes by {m} calibrations: </source>
        <translation>{n} Ebenen mit {m} Kalibrierungen: </translation>
    </message>
    <message>
        <source>evaluated.</source>
        <translation>beurteilt.</translation>
    </message>
    <message>
        <source>not evaluated yet.</source>
        <translation>noch nicht beurteilt.</translation>
    </message>
    <message>
        <source>This evaluation is out of date: {reason}.</source>
        <translation>Diese Beurteilung ist veraltet: {reason}.</translation>
    </message>
    <message>
        <source>Capture planes first: captures of the role plane-table.</source>
        <translation>Zuerst Ebenen aufnehmen: Aufnahmen der Rolle Planplatte.</translation>
    </message>
    <message>
        <source>Calibrate first.</source>
        <translation>Zuerst kalibrieren.</translation>
    </message>
    <message>
        <source>Tick a plane.</source>
        <translation>Eine Ebene ankreuzen.</translation>
    </message>
    <message>
        <source>Tick a calibration.</source>
        <translation>Eine Kalibrierung ankreuzen.</translation>
    </message>
    <message>
        <source>Not evaluated yet: {reason}.</source>
        <translation>Noch nicht beurteilt: {reason}.</translation>
    </message>
</context>
<context>
    <name>Failures</name>
    <message>
        <source>out of memory</source>
        <translation>der Speicher reicht nicht</translation>
    </message>
    <message>
        <source>close other programs, or use fewer captures</source>
        <translation>andere Programme schließen, oder weniger Aufnahmen verwenden</translation>
    </message>
    <message>
        <source>see to the disk and the folder&apos;s permissions</source>
        <translation>nach der Platte und den Rechten am Ordner sehen</translation>
    </message>
    <message>
        <source>the program met something it was not written for ({kind}: {error})</source>
        <translation>das Programm ist auf etwas gestoßen, wofür es nicht geschrieben ist ({kind}: {error})</translation>
    </message>
    <message>
        <source>report it with the details; your data are untouched</source>
        <translation>mit den Einzelheiten melden; die Daten sind unberührt</translation>
    </message>
</context>
<context>
    <name>FieldMap</name>
    <message>
        <source>Map of the testfield</source>
        <translation>Plan des Testfelds</translation>
    </message>
    <message>
        <source>at work: row {r}, column {c}; {n} picked, {m} measured</source>
        <translation>in Arbeit: Zeile {r}, Spalte {c}; {n} angewählt, {m} gemessen</translation>
    </message>
</context>
<context>
    <name>FramesStep</name>
    <message>
        <source>Folder of the images</source>
        <translation>Ordner der Bilder</translation>
    </message>
    <message>
        <source>Choose…</source>
        <translation>Wählen …</translation>
    </message>
    <message>
        <source>Choose the folder of the images</source>
        <translation>Den Ordner der Bilder wählen</translation>
    </message>
    <message>
        <source>Images</source>
        <translation>Bilder</translation>
    </message>
    <message>
        <source>All images of one sequence, of the size that the project&apos;s camera has. A capture.json beside them says what each shows. The files stay where they are; the project gets copies.</source>
        <translation>Alle Bilder einer Folge, so groß wie die der Kamera im Projekt. Eine capture.json daneben sagt, was jedes zeigt. Die Dateien bleiben, wo sie sind; das Projekt erhält Kopien.</translation>
    </message>
    <message>
        <source>Choose the folder that holds the images</source>
        <translation>Den Ordner mit den Bildern wählen</translation>
    </message>
</context>
<context>
    <name>HealthStrip</name>
    <message>
        <source>Drift chart</source>
        <translation>Driftkarte</translation>
    </message>
    <message>
        <source>Looking whether the rig has moved …</source>
        <translation>Ob sich der Aufbau bewegt hat, wird angesehen …</translation>
    </message>
</context>
<context>
    <name>HelpPanel</name>
    <message>
        <source>Help</source>
        <translation>Hilfe</translation>
    </message>
    <message>
        <source>Help text</source>
        <translation>Hilfetext</translation>
    </message>
    <message>
        <source>Close help</source>
        <translation>Hilfe schließen</translation>
    </message>
    <message>
        <source>There is no help for this page.</source>
        <translation>Zu dieser Seite gibt es keine Hilfe.</translation>
    </message>
</context>
<context>
    <name>Histogram</name>
    <message>
        <source>deviation [{unit}]; the outermost steps hold all beyond</source>
        <translation>Abweichung [{unit}]; die äußersten Stufen enthalten alles darüber hinaus</translation>
    </message>
    <message>
        <source>deviation [{unit}]</source>
        <translation>Abweichung [{unit}]</translation>
    </message>
    <message>
        <source>share of pixels [%]</source>
        <extracomment>for the legend; empty for none x, y: of equal length, or one x more than y for steps. NaN leaves a gap. 0 or 1: which of the theme&apos;s two colours for marks {&quot;line&quot;, &quot;dash&quot;, &quot;dot&quot;, &quot;dash-dot&quot;} the area between ±band is tinted whether its points are marked: few values, each measured</extracomment>
        <translation>Anteil der Pixel [%]</translation>
    </message>
</context>
<context>
    <name>HistogramPart</name>
    <message>
        <source>Plane of the histogram</source>
        <translation>Ebene des Histogramms</translation>
    </message>
    <message>
        <source>Histogram of the deviations</source>
        <translation>Histogramm der Abweichungen</translation>
    </message>
    <message>
        <source>Plane</source>
        <translation>Ebene</translation>
    </message>
    <message>
        <source>all planes</source>
        <translation>alle Ebenen</translation>
    </message>
    <message>
        <source>normal, {rms} mm</source>
        <translation>normal, {rms} mm</translation>
    </message>
</context>
<context>
    <name>ImagePanel</name>
    <message>
        <source>Image with its targets</source>
        <translation>Bild mit seinen Marken</translation>
    </message>
    <message>
        <source>1 to 4 and Tab choose a target, arrows move the cross hairs, Space picks, Enter does the next step, F6 goes to the map and the lists.</source>
        <translation>1 bis 4 und Tab wählen eine Marke, Pfeile bewegen das Fadenkreuz, Leertaste wählt an, Eingabe tut den nächsten Schritt, F6 führt zum Plan und zu den Listen.</translation>
    </message>
    <message>
        <source>Arrows: 1 px, Shift 0.1 px, Ctrl next dot · Space: pick · 1–4, Tab: target · X: exclude · Page Up, Down: image · F6: map and lists</source>
        <translation>Pfeile: 1 px, Umschalt 0.1 px, Strg nächster Punkt · Leertaste: anwählen · 1–4, Tab: Marke · X: ausschließen · Bild auf, ab: Bild · F6: Plan, Listen</translation>
    </message>
    <message>
        <source>Exclude (X)</source>
        <translation>Ausschließen (X)</translation>
    </message>
    <message>
        <source>Whole image</source>
        <translation>Ganzes Bild</translation>
    </message>
    <message>
        <source>Restore (X)</source>
        <translation>Wieder verwenden (X)</translation>
    </message>
</context>
<context>
    <name>ImageView</name>
    <message>
        <source>Plus and minus zoom, the arrow keys move, 0 shows the whole image.</source>
        <translation>Plus und Minus vergrößern und verkleinern, die Pfeiltasten verschieben, 0 zeigt das ganze Bild.</translation>
    </message>
    <message>
        <source>Value under the cursor</source>
        <translation>Wert unter dem Zeiger</translation>
    </message>
    <message>
        <source>Move the cursor over the image to read values.</source>
        <translation>Den Zeiger über das Bild bewegen, um Werte zu lesen.</translation>
    </message>
    <message>
        <source>no value</source>
        <translation>kein Wert</translation>
    </message>
</context>
<context>
    <name>ImportStep</name>
    <message>
        <source>Import the frames</source>
        <translation>Bilder einlesen</translation>
    </message>
    <message>
        <source>What the checks said</source>
        <translation>Was die Prüfungen ergaben</translation>
    </message>
    <message>
        <source>Import the frames.</source>
        <translation>Die Bilder einlesen.</translation>
    </message>
</context>
<context>
    <name>ImportWizard</name>
    <message>
        <source>Import frames</source>
        <translation>Bilder einlesen</translation>
    </message>
    <message>
        <source>Make a capture of images that another program has taken.</source>
        <translation>Aus Bildern, die ein anderes Programm aufgenommen hat, eine Aufnahme machen.</translation>
    </message>
    <message>
        <source>Done</source>
        <translation>Fertig</translation>
    </message>
    <message>
        <source>As the folder says, else the project&apos;s</source>
        <translation>Wie der Ordner sagt, sonst die des Projekts</translation>
    </message>
    <message>
        <source>Which image shows which pattern</source>
        <translation>Welches Bild welches Muster zeigt</translation>
    </message>
    <message>
        <source>Images</source>
        <translation>Bilder</translation>
    </message>
    <message>
        <source>What</source>
        <translation>Was</translation>
    </message>
    <message>
        <source>Sequence</source>
        <translation>Folge</translation>
    </message>
    <message>
        <source>Import</source>
        <translation>Einlesen</translation>
    </message>
    <message>
        <source>reading and checking the images …</source>
        <translation>Bilder werden gelesen und geprüft …</translation>
    </message>
    <message>
        <source>Stopped. Nothing was imported.</source>
        <translation>Abgebrochen. Nichts wurde eingelesen.</translation>
    </message>
    <message>
        <source>Choose the sequence: neither the folder nor the project says which it is.</source>
        <translation>Die Folge wählen: weder der Ordner noch das Projekt sagt, welche es ist.</translation>
    </message>
    <message>
        <source>{n} images become the capture {name}.</source>
        <translation>{n} Bilder werden zur Aufnahme {name}.</translation>
    </message>
</context>
<context>
    <name>Importing</name>
    <message>
        <source>Choose the folder that holds the images.</source>
        <translation>Den Ordner mit den Bildern wählen.</translation>
    </message>
    <message>
        <source>There are no images (PNG, TIFF, BMP, JPEG) in this folder.</source>
        <translation>In diesem Ordner sind keine Bilder (PNG, TIFF, BMP, JPEG).</translation>
    </message>
    <message>
        <source>{n} images, {first} to {last}, {w} × {h} px.</source>
        <translation>{n} Bilder, {first} bis {last}, {w} × {h} px.</translation>
    </message>
    <message>
        <source>Unless another is chosen they show: {sequence}, {n} patterns.</source>
        <translation>Ist keine andere gewählt, zeigen sie: {sequence}, {n} Muster.</translation>
    </message>
    <message>
        <source>as the list of patterns names the files, else by name</source>
        <translation>wie die Liste der Muster die Dateien nennt, sonst nach Namen</translation>
    </message>
    <message>
        <source>by the files&apos; names, numbers counted</source>
        <translation>nach den Namen der Dateien, Zahlen gezählt</translation>
    </message>
    <message>
        <source>found from the images themselves</source>
        <translation>aus den Bildern selbst gefunden</translation>
    </message>
    <message>
        <source>in the order of their names</source>
        <translation>in der Reihenfolge ihrer Namen</translation>
    </message>
    <message>
        <source>as the list names them</source>
        <translation>wie die Liste sie nennt</translation>
    </message>
    <message>
        <source>in the order found from the images</source>
        <translation>in der Reihenfolge, die aus den Bildern folgt</translation>
    </message>
    <message>
        <source>{n} frames are in {folder}, {order}.</source>
        <translation>{n} Bilder liegen in {folder}, {order}.</translation>
    </message>
    <message>
        <source>The images do not show this sequence: see what the checks found, and try another.</source>
        <translation>Die Bilder zeigen diese Folge nicht: siehe, was die Prüfungen ergaben, und eine andere versuchen.</translation>
    </message>
</context>
<context>
    <name>JobBar</name>
    <message>
        <source>Progress</source>
        <translation>Fortschritt</translation>
    </message>
    <message>
        <source>Cancel</source>
        <translation>Abbrechen</translation>
    </message>
    <message>
        <source>Cancel the running work</source>
        <translation>Laufende Arbeit abbrechen</translation>
    </message>
    <message>
        <source>{title}: stopping …</source>
        <translation>{title}: hält an …</translation>
    </message>
    <message>
        <source> (+{n} waiting)</source>
        <translation> (+{n} warten)</translation>
    </message>
    <message>
        <source>{n} s left</source>
        <translation>noch {n} s</translation>
    </message>
    <message>
        <source>{n} min left</source>
        <translation>noch {n} min</translation>
    </message>
</context>
<context>
    <name>Layout</name>
    <message>
        <source>Whole image</source>
        <translation>Ganzes Bild</translation>
    </message>
</context>
<context>
    <name>LineTool</name>
    <message>
        <source>Keys 1 and 2 choose an end of the line, the arrow keys move it, with Shift by ten pixels.</source>
        <translation>Die Tasten 1 und 2 wählen ein Ende der Linie, die Pfeiltasten bewegen es, mit Umschalt um zehn Pixel.</translation>
    </message>
</context>
<context>
    <name>Loupe</name>
    <message>
        <source>Loupe, 8 times</source>
        <translation>Lupe, 8-fach</translation>
    </message>
</context>
<context>
    <name>MainWindow</name>
    <message>
        <source>Stripe workbench</source>
        <translation>Streifenprojektion</translation>
    </message>
    <message>
        <source>Stripe workbench {version}
Decode, calibrate, reconstruct and evaluate stripe projectors.

{licence}</source>
        <translation>Stripe workbench {version}
Streifenprojektoren dekodieren, kalibrieren, rekonstruieren und beurteilen.

{licence}</translation>
    </message>
    <message>
        <source>BSD-3-Clause licence.</source>
        <translation>BSD-3-Clause-Lizenz.</translation>
    </message>
    <message>
        <source>About</source>
        <translation>Über</translation>
    </message>
    <message>
        <source>{title} is still running. Its result is lost if you stop it now.</source>
        <translation>{title} läuft noch. Das Ergebnis geht verloren, wenn Sie jetzt anhalten.</translation>
    </message>
    <message>
        <source>Work is running</source>
        <translation>Eine Arbeit läuft</translation>
    </message>
    <message>
        <source>Stop and close</source>
        <translation>Anhalten und schließen</translation>
    </message>
    <message>
        <source>Keep working</source>
        <translation>Weiterarbeiten</translation>
    </message>
</context>
<context>
    <name>MapPage</name>
    <message>
        <source>Map</source>
        <translation>Karte</translation>
    </message>
    <message>
        <source>Captures</source>
        <translation>Aufnahmen</translation>
    </message>
</context>
<context>
    <name>Measure</name>
    <message>
        <source>u projector [lines]</source>
        <translation>u Projektor [Linien]</translation>
    </message>
    <message>
        <source>v projector [lines]</source>
        <translation>v Projektor [Linien]</translation>
    </message>
</context>
<context>
    <name>MeasurePage</name>
    <message>
        <source>Measure</source>
        <translation>Messen</translation>
    </message>
    <message>
        <source>Targets that cannot be recognised follow from four picks in the image.</source>
        <translation>Zielmarken, die nicht erkannt werden, folgen aus vier angewählten im Bild.</translation>
    </message>
    <message>
        <source>Undo</source>
        <translation>Rückgängig</translation>
    </message>
    <message>
        <source>Take the last change back, in whichever image it was made (Ctrl+Z)</source>
        <translation>Die letzte Änderung zurücknehmen, in welchem Bild sie auch geschah (Strg+Z)</translation>
    </message>
    <message>
        <source>Redo</source>
        <translation>Wiederholen</translation>
    </message>
    <message>
        <source>Make it again (Ctrl+Shift+Z)</source>
        <translation>Sie wieder ausführen (Strg+Umschalt+Z)</translation>
    </message>
    <message>
        <source>Measure all</source>
        <translation>Alle messen</translation>
    </message>
    <message>
        <source>Measure the targets of all captures that have picks (F5).</source>
        <translation>Die Zielmarken aller Aufnahmen mit angewählten Marken messen (F5).</translation>
    </message>
    <message>
        <source>Accept and measure</source>
        <translation>Annehmen und messen</translation>
    </message>
    <message>
        <source>no board</source>
        <translation>keine Tafel</translation>
    </message>
    <message>
        <source>Capture a testfield first; its board must be named in capture.json.</source>
        <translation>Zuerst ein Testfeld aufnehmen; seine Tafel muss in capture.json genannt sein.</translation>
    </message>
    <message>
        <source>Space</source>
        <translation>Leertaste</translation>
    </message>
    <message>
        <source>Enter</source>
        <translation>Eingabe</translation>
    </message>
    <message>
        <source>There is no dot under the cross hairs; Shift+Space picks all the same.</source>
        <translation>Unter dem Fadenkreuz ist kein Punkt; Umschalt+Leertaste wählt trotzdem an.</translation>
    </message>
    <message>
        <source>{n} targets in {m} captures.</source>
        <translation>{n} Zielmarken in {m} Aufnahmen.</translation>
    </message>
</context>
<context>
    <name>Menus</name>
    <message>
        <source>&amp;Project</source>
        <translation>&amp;Projekt</translation>
    </message>
    <message>
        <source>E&amp;dit</source>
        <translation>Bea&amp;rbeiten</translation>
    </message>
    <message>
        <source>&amp;Go</source>
        <translation>&amp;Gehe zu</translation>
    </message>
    <message>
        <source>&amp;Run</source>
        <translation>&amp;Ausführen</translation>
    </message>
    <message>
        <source>&amp;Capture</source>
        <translation>Auf&amp;nehmen</translation>
    </message>
    <message>
        <source>&amp;View</source>
        <translation>Ansi&amp;cht</translation>
    </message>
    <message>
        <source>&amp;Help</source>
        <translation>&amp;Hilfe</translation>
    </message>
</context>
<context>
    <name>NewProject</name>
    <message>
        <source>New project</source>
        <translation>Neues Projekt</translation>
    </message>
    <message>
        <source>Give the project a name.</source>
        <translation>Dem Projekt einen Namen geben.</translation>
    </message>
    <message>
        <source>Choose a folder for the project.</source>
        <translation>Einen Ordner für das Projekt wählen.</translation>
    </message>
    <message>
        <source>Give the folder in full, such as {example}.</source>
        <translation>Den Ordner vollständig angeben, etwa {example}.</translation>
    </message>
    <message>
        <source>Choose the CSV file with the targets.</source>
        <translation>Die CSV-Datei mit den Zielmarken wählen.</translation>
    </message>
    <message>
        <source>{n} targets: a testfield needs at least 4, not all in one row or column.</source>
        <translation>{n} Marken: ein Testfeld braucht mindestens 4, nicht alle in einer Zeile oder Spalte.</translation>
    </message>
    <message>
        <source>Neighbouring targets overlap: choose a diameter below the spacing.</source>
        <translation>Benachbarte Marken überlappen sich: einen Durchmesser unter dem Abstand wählen.</translation>
    </message>
    <message>
        <source>{n} targets from {file}</source>
        <translation>{n} Marken aus {file}</translation>
    </message>
    <message>
        <source>white on black</source>
        <translation>weiß auf schwarz</translation>
    </message>
    <message>
        <source>black on white</source>
        <translation>schwarz auf weiß</translation>
    </message>
    <message>
        <source>{rows} rows × {columns} columns, spacing {a:g} mm, diameter {d:g} mm, {polarity}</source>
        <translation>{rows} Zeilen × {columns} Spalten, Abstand {a:g} mm, Durchmesser {d:g} mm, {polarity}</translation>
    </message>
    <message>
        <source>{n} targets on {wide:.0f} × {high:.0f} mm, each {across:.1f} px across in the camera.</source>
        <translation>{n} Marken auf {wide:.0f} × {high:.0f} mm, jede in der Kamera {across:.1f} px groß.</translation>
    </message>
    <message>
        <source>That is small: below {least:.0f} px blur and pixels spoil the centroid.</source>
        <translation>Das ist klein: unter {least:.0f} px verderben Unschärfe und Pixel den Schwerpunkt.</translation>
    </message>
    <message>
        <source>It is larger than the camera&apos;s field of {w:.0f} × {h:.0f} mm.</source>
        <translation>Es ist größer als das Feld der Kamera von {w:.0f} × {h:.0f} mm.</translation>
    </message>
    <message>
        <source>It fills {share:.0f} % of the camera&apos;s field: move it into the image&apos;s corners too.</source>
        <translation>Es füllt {share:.0f} % des Feldes der Kamera: es auch in die Ecken des Bildes bewegen.</translation>
    </message>
    <message>
        <source>The projector lights {w:.0f} × {h:.0f} mm: targets beside it serve the camera only.</source>
        <translation>Der Projektor beleuchtet {w:.0f} × {h:.0f} mm: Marken daneben nützen nur der Kamera.</translation>
    </message>
    <message>
        <source>There is no target in row {row}, column {col}.</source>
        <translation>In Zeile {row}, Spalte {col} ist keine Marke.</translation>
    </message>
    <message>
        <source>Name two different targets.</source>
        <translation>Zwei verschiedene Marken nennen.</translation>
    </message>
    <message>
        <source>Type the measured length.</source>
        <translation>Die gemessene Länge eingeben.</translation>
    </message>
    <message>
        <source>Type the standard deviation of the measured length.</source>
        <translation>Die Standardabweichung der gemessenen Länge eingeben.</translation>
    </message>
    <message>
        <source>Nominal distance: {nominal:.3f} mm.</source>
        <translation>Nennabstand: {nominal:.3f} mm.</translation>
    </message>
    <message>
        <source>Nominal distance: {nominal:.3f} mm; measured {off:+.3f} mm ({share:+.3f} %).</source>
        <translation>Nennabstand: {nominal:.3f} mm; gemessen {off:+.3f} mm ({share:+.3f} %).</translation>
    </message>
    <message>
        <source>So large a difference is rarely true: check the two targets, and that it is in mm.</source>
        <translation>Ein so großer Unterschied stimmt selten: die zwei Marken prüfen, und dass es mm sind.</translation>
    </message>
    <message>
        <source>Reference rig: SONY XC75, cross-pattern LCD</source>
        <extracomment>from either device to the middle of the object plane from device to device its place in the plan: x along the base, y from the object plane (0) away; the object&apos;s middle is the origin width and height of its field square to its axis at the working distance where its outermost rays meet the object plane one pixel, or one line, at the working distance angle between the axes width in the object plane that both cover how far a point moves along the camera&apos;s axis while the projector&apos;s coordinate changes by one line</extracomment>
        <translation>Referenzaufbau: SONY XC75, Kreuzmuster-LCD</translation>
    </message>
    <message>
        <source>5 Mpx camera, HDMI projector</source>
        <translation>5-Mpx-Kamera, HDMI-Projektor</translation>
    </message>
    <message>
        <source>camera {w} × {h} px of {px:g} × {py:g} µm, focal length {c:g} mm</source>
        <translation>Kamera {w} × {h} px zu {px:g} × {py:g} µm, Brennweite {c:g} mm</translation>
    </message>
    <message>
        <source>projector {w} × {h} lines of {px:g} × {py:g} µm, focal length {c:g} mm</source>
        <translation>Projektor {w} × {h} Linien zu {px:g} × {py:g} µm, Brennweite {c:g} mm</translation>
    </message>
    <message>
        <source>The base has to be shorter than the working distance.</source>
        <translation>Die Basis muss kürzer sein als der Arbeitsabstand.</translation>
    </message>
    <message>
        <source>Rays of a device miss the object: its image is too wide for this focal length.</source>
        <translation>Strahlen eines Geräts verfehlen das Objekt: sein Bild ist zu breit für diese Brennweite.</translation>
    </message>
    <message>
        <source>The axes meet at {angle:.0f}°: depth is weak below {least:.0f}°, widen the base.</source>
        <translation>Die Achsen schneiden sich unter {angle:.0f}°: unter {least:.0f}° ist die Tiefe schwach, die Basis vergrößern.</translation>
    </message>
    <message>
        <source>The axes meet at {angle:.0f}°: above {most:.0f}° much of an object is in shadow.</source>
        <translation>Die Achsen schneiden sich unter {angle:.0f}°: über {most:.0f}° liegt viel vom Objekt im Schatten.</translation>
    </message>
    <message>
        <source>Camera and projector have only {common:.0f} mm of the object plane in common.</source>
        <translation>Kamera und Projektor haben nur {common:.0f} mm der Objektebene gemeinsam.</translation>
    </message>
    <message>
        <source>Write the testfield at true size</source>
        <translation>Das Testfeld maßhaltig schreiben</translation>
    </message>
    <message>
        <source>{out}: a page of {w:.0f} × {h:.0f} mm.</source>
        <translation>{out}: eine Seite von {w:.0f} × {h:.0f} mm.</translation>
    </message>
    <message>
        <source>Print at 100 %; its bars must then measure {across:g} mm across and {down:g} mm down.</source>
        <translation>Mit 100 % drucken; seine Strecken müssen dann {across:g} mm quer und {down:g} mm hoch messen.</translation>
    </message>
    <message>
        <source>Testfield to print</source>
        <translation>Testfeld zum Drucken</translation>
    </message>
</context>
<context>
    <name>NewProjectWizard</name>
    <message>
        <source>New project</source>
        <translation>Neues Projekt</translation>
    </message>
    <message>
        <source>What the project is called, what rig and boards it is about. All can be typed; little has to be.</source>
        <translation>Wie das Projekt heißt, um welchen Aufbau und welche Tafeln es geht. Alles lässt sich eingeben; nur wenig muss.</translation>
    </message>
    <message>
        <source>Create project</source>
        <translation>Projekt anlegen</translation>
    </message>
    <message>
        <source>This project has a depth plate</source>
        <translation>Dieses Projekt hat eine Tiefenplatte</translation>
    </message>
    <message>
        <source>A flat plate with a few targets, moved along an axis: for the polynomial depth calibration only.</source>
        <translation>Eine ebene Platte mit einigen Marken, längs einer Achse bewegt: nur für die Tiefenkalibrierung mit dem Polynom.</translation>
    </message>
    <message>
        <source>The projector&apos;s own, chosen when it answers</source>
        <translation>Die des Projektors, gewählt, sobald er antwortet</translation>
    </message>
    <message>
        <source>Name and place</source>
        <translation>Name und Ort</translation>
    </message>
    <message>
        <source>Rig</source>
        <translation>Aufbau</translation>
    </message>
    <message>
        <source>Testfield</source>
        <translation>Testfeld</translation>
    </message>
    <message>
        <source>Depth plate</source>
        <translation>Tiefenplatte</translation>
    </message>
    <message>
        <source>Scale</source>
        <translation>Maßstab</translation>
    </message>
    <message>
        <source>Sequence</source>
        <translation>Folge</translation>
    </message>
    <message>
        <source>Summary</source>
        <translation>Übersicht</translation>
    </message>
    <message>
        <source>Work is running in the open project.</source>
        <translation>Im offenen Projekt läuft eine Arbeit.</translation>
    </message>
    <message>
        <source>wait until it is done, or cancel it</source>
        <translation>warten, bis sie fertig ist, oder sie abbrechen</translation>
    </message>
    <message>
        <source>The project is ready for its first captures: {folder}.</source>
        <translation>Das Projekt ist bereit für die ersten Aufnahmen: {folder}.</translation>
    </message>
    <message>
        <source>Project &gt; Print testfield gives the board at true size.</source>
        <translation>Projekt &gt; Testfeld drucken gibt die Tafel maßhaltig aus.</translation>
    </message>
</context>
<context>
    <name>NextPose</name>
    <message>
        <source>Tries 108 poses of the board by their covariance: which to capture next, one after the other.</source>
        <translation>Versucht 108 Stellungen der Tafel mit der Kovarianz: welche als Nächste aufzunehmen sind, der Reihe nach.</translation>
    </message>
    <message>
        <source>Next poses</source>
        <translation>Nächste Stellungen</translation>
    </message>
    <message>
        <source>Find the best poses</source>
        <translation>Beste Stellungen suchen</translation>
    </message>
</context>
<context>
    <name>NoticeBox</name>
    <message>
        <source>Put this notice away</source>
        <translation>Diesen Hinweis wegräumen</translation>
    </message>
    <message>
        <source>Details</source>
        <translation>Einzelheiten</translation>
    </message>
    <message>
        <source>Copy</source>
        <translation>Kopieren</translation>
    </message>
    <message>
        <source>Note</source>
        <translation>Hinweis</translation>
    </message>
    <message>
        <source>Done</source>
        <translation>Fertig</translation>
    </message>
    <message>
        <source>Warning</source>
        <translation>Warnung</translation>
    </message>
    <message>
        <source>Error</source>
        <translation>Fehler</translation>
    </message>
</context>
<context>
    <name>PairChoice</name>
    <message>
        <source>Camera and projector</source>
        <translation>Kamera und Projektor</translation>
    </message>
    <message>
        <source>Whose frames are shown.</source>
        <translation>Wessen Bilder gezeigt werden.</translation>
    </message>
    <message>
        <source>{camera} with {projector}</source>
        <translation>{camera} mit {projector}</translation>
    </message>
</context>
<context>
    <name>PatternStrip</name>
    <message>
        <source>{text} (a part, enlarged)</source>
        <translation>{text} (ein Ausschnitt, vergrößert)</translation>
    </message>
    <message>
        <source>taken</source>
        <translation>aufgenommen</translation>
    </message>
    <message>
        <source>to be taken again</source>
        <translation>noch einmal aufzunehmen</translation>
    </message>
    <message>
        <source>not taken yet</source>
        <translation>noch nicht aufgenommen</translation>
    </message>
</context>
<context>
    <name>PatternWindow</name>
    <message>
        <source>Patterns</source>
        <translation>Muster</translation>
    </message>
    <message>
        <source>Patterns of the projector</source>
        <translation>Muster des Projektors</translation>
    </message>
</context>
<context>
    <name>Picking</name>
    <message>
        <source>row</source>
        <translation>Zeile</translation>
    </message>
    <message>
        <source>col</source>
        <translation>Spalte</translation>
    </message>
    <message>
        <source>what became of it</source>
        <translation>was daraus wurde</translation>
    </message>
    <message>
        <source>excluded by the operator</source>
        <translation>vom Bediener ausgeschlossen</translation>
    </message>
    <message>
        <source>measured</source>
        <translation>gemessen</translation>
    </message>
    <message>
        <source>{n} measured, {m} missing; residuals drawn {f:g} times, r.m.s. {r:.2f} px (pose and nominal c)</source>
        <translation>{n} gemessen, {m} fehlen; Verbesserungen {f:g}-fach gezeichnet, r.m.s. {r:.2f} px (Orientierung und Nennwert von c)</translation>
    </message>
    <message>
        <source>A guess, one of {n}: is target 1 where the map has it? R shows the next one.</source>
        <translation>Ein Vorschlag, einer von {n}: liegt Marke 1 dort, wo der Plan sie hat? R zeigt den nächsten.</translation>
    </message>
    <message>
        <source>A guess: are the targets where the map has them?</source>
        <translation>Ein Vorschlag: liegen die Marken dort, wo der Plan sie hat?</translation>
    </message>
    <message>
        <source>The circles are where the picks put the targets: do they lie on the dots?</source>
        <translation>Die Kreise zeigen, wo die Marken danach sein müssten: liegen sie auf den Punkten?</translation>
    </message>
    <message>
        <source>being measured</source>
        <translation>wird gemessen</translation>
    </message>
    <message>
        <source>{n} measured, {m} missing</source>
        <translation>{n} gemessen, {m} fehlen</translation>
    </message>
    <message>
        <source>refused: {why}</source>
        <translation>abgelehnt: {why}</translation>
    </message>
    <message>
        <source>picked, not measured</source>
        <translation>angewählt, nicht gemessen</translation>
    </message>
    <message>
        <source>{n} of 4 picked</source>
        <translation>{n} von 4 angewählt</translation>
    </message>
    <message>
        <source>no picks yet</source>
        <translation>noch keine Marken angewählt</translation>
    </message>
    <message>
        <source>row {r}, column {c}</source>
        <translation>Zeile {r}, Spalte {c}</translation>
    </message>
    <message>
        <source>Pick here</source>
        <translation>Hier anwählen</translation>
    </message>
    <message>
        <source>Accept the guess</source>
        <translation>Vorschlag annehmen</translation>
    </message>
    <message>
        <source>Accept and measure</source>
        <translation>Annehmen und messen</translation>
    </message>
    <message>
        <source>Next image</source>
        <translation>Nächstes Bild</translation>
    </message>
    <message>
        <source>All picked: calibrate</source>
        <translation>Alle fertig: kalibrieren</translation>
    </message>
    <message>
        <source>Target {k} of {n}: {target}. Click its dot, or bring the cross hairs there and press Space.</source>
        <translation>Marke {k} von {n}: {target}. Ihren Punkt anklicken, oder das Fadenkreuz dorthin bringen und die Leertaste drücken.</translation>
    </message>
    <message>
        <source>{target}: {fate}</source>
        <translation>{target}: {fate}</translation>
    </message>
    <message>
        <source>At work: {target}</source>
        <translation>In Arbeit: {target}</translation>
    </message>
</context>
<context>
    <name>PictureStep</name>
    <message>
        <source>Live picture</source>
        <translation>Livebild</translation>
    </message>
    <message>
        <source>Light</source>
        <translation>Licht</translation>
    </message>
    <message>
        <source>White</source>
        <translation>Weiß</translation>
    </message>
    <message>
        <source>Finest stripes</source>
        <translation>Feinste Streifen</translation>
    </message>
    <message>
        <source>Black</source>
        <translation>Schwarz</translation>
    </message>
    <message>
        <source>Live</source>
        <translation>Live</translation>
    </message>
    <message>
        <source>Over-exposed</source>
        <translation>Überbelichtet</translation>
    </message>
    <message>
        <source>This camera&apos;s exposure is set on the camera itself, or by its own program.</source>
        <translation>Die Belichtung dieser Kamera wird an ihr selbst eingestellt oder mit ihrem eigenen Programm.</translation>
    </message>
    <message>
        <source>Whole image</source>
        <translation>Ganzes Bild</translation>
    </message>
    <message>
        <source>A good next pose, by the calibration in use: {words}.</source>
        <translation>Eine gute nächste Stellung nach der verwendeten Kalibrierung: {words}.</translation>
    </message>
    <message>
        <source>The brightest places use {share:.0f} % of the camera&apos;s range.</source>
        <translation>Die hellsten Stellen nutzen {share:.0f} % des Bereichs der Kamera.</translation>
    </message>
    <message>
        <source>The hatched pixels are over-exposed: expose less or close the aperture.</source>
        <translation>Die schraffierten Pixel sind überbelichtet: kürzer belichten oder abblenden.</translation>
    </message>
    <message>
        <source>There is room: expose longer or open the aperture.</source>
        <translation>Da ist noch Spielraum: länger belichten oder aufblenden.</translation>
    </message>
    <message>
        <source>Nothing that matters is over-exposed.</source>
        <translation>Nichts Wesentliches ist überbelichtet.</translation>
    </message>
    <message>
        <source>Gain</source>
        <translation>Verstärkung</translation>
    </message>
    <message>
        <source>Exposure</source>
        <translation>Belichtung</translation>
    </message>
</context>
<context>
    <name>PlaceStep</name>
    <message>
        <source>Name of the project</source>
        <translation>Name des Projekts</translation>
    </message>
    <message>
        <source>Folder of the project</source>
        <translation>Ordner des Projekts</translation>
    </message>
    <message>
        <source>Choose…</source>
        <translation>Wählen …</translation>
    </message>
    <message>
        <source>Choose the folder</source>
        <translation>Den Ordner wählen</translation>
    </message>
    <message>
        <source>Name</source>
        <translation>Name</translation>
    </message>
    <message>
        <source>Folder</source>
        <translation>Ordner</translation>
    </message>
    <message>
        <source>A project is a folder: the rig and the boards in small files, every capture in a folder of its own, and the results. The folder has to be new or empty; it can be moved and copied as a whole.</source>
        <translation>Ein Projekt ist ein Ordner: der Aufbau und die Tafeln in kleinen Dateien, jede Aufnahme in einem eigenen Ordner, und die Ergebnisse. Der Ordner muss neu oder leer sein; er lässt sich als Ganzes verschieben und kopieren.</translation>
    </message>
    <message>
        <source>Choose a new or empty folder for the project</source>
        <translation>Einen neuen oder leeren Ordner für das Projekt wählen</translation>
    </message>
</context>
<context>
    <name>PlaneTable</name>
    <message>
        <source>not evaluated</source>
        <translation>nicht beurteilt</translation>
    </message>
    <message>
        <source>changed since it was evaluated</source>
        <translation>seit der Beurteilung geändert</translation>
    </message>
    <message>
        <source>evaluated</source>
        <translation>beurteilt</translation>
    </message>
    <message>
        <source>calibrated {when}</source>
        <translation>kalibriert {when}</translation>
    </message>
    <message>
        <source>run {n}</source>
        <translation>Lauf {n}</translation>
    </message>
    <message>
        <source>out of date: {reason}</source>
        <translation>veraltet: {reason}</translation>
    </message>
    <message>
        <source>up to date</source>
        <translation>aktuell</translation>
    </message>
</context>
<context>
    <name>PointMap</name>
    <message>
        <source>Direction of the sigma</source>
        <translation>Richtung des σ</translation>
    </message>
    <message>
        <source>X, Y and Z together</source>
        <translation>X, Y und Z zusammen</translation>
    </message>
    <message>
        <source>Sigmas of the object points over the testfield</source>
        <translation>σ der Objektpunkte über dem Testfeld</translation>
    </message>
    <message>
        <source>Object points</source>
        <translation>Objektpunkte</translation>
    </message>
    <message>
        <source>Sigma in</source>
        <translation>σ in</translation>
    </message>
    <message>
        <source>point</source>
        <translation>Punkt</translation>
    </message>
    <message>
        <source>images</source>
        <translation>Bilder</translation>
    </message>
    <message>
        <source>R.m.s. {x:.1f}, {y:.1f}, {z:.1f} µm in X, Y, Z. Least certain: {worst}.</source>
        <translation>R.m.s. {x:.1f}, {y:.1f}, {z:.1f} µm in X, Y, Z. Am unsichersten: {worst}.</translation>
    </message>
    <message>
        <source>Point at a target to read its sigmas.</source>
        <translation>Auf eine Marke zeigen, um ihre σ zu lesen.</translation>
    </message>
</context>
<context>
    <name>ProfilePart</name>
    <message>
        <source>Plane</source>
        <translation>Ebene</translation>
    </message>
    <message>
        <source>Draw a line with the mouse; keys 1, 2 and the arrows move its ends.</source>
        <translation>Eine Linie mit der Maus ziehen; die Tasten 1, 2 und die Pfeile bewegen ihre Enden.</translation>
    </message>
    <message>
        <source>Horizontal</source>
        <translation>Waagrecht</translation>
    </message>
    <message>
        <source>Vertical</source>
        <translation>Senkrecht</translation>
    </message>
    <message>
        <source>Diagonal</source>
        <translation>Diagonal</translation>
    </message>
    <message>
        <source>Deviations along the line</source>
        <translation>Abweichungen längs der Linie</translation>
    </message>
    <message>
        <source>length [mm]</source>
        <translation>Länge [mm]</translation>
    </message>
    <message>
        <source>deviation [µm]</source>
        <translation>Abw. [µm]</translation>
    </message>
    <message>
        <source>{said}, tinted: ±σ predicted</source>
        <translation>{said}, getönt: ±σ vorhergesagt</translation>
    </message>
    <message>
        <source>{a:.0f}, {b:.0f} to {c:.0f}, {d:.0f} px</source>
        <translation>{a:.0f}, {b:.0f} bis {c:.0f}, {d:.0f} px</translation>
    </message>
</context>
<context>
    <name>Reconstruct</name>
    <message>
        <source>Shaded height</source>
        <translation>Schattierte Höhe</translation>
    </message>
    <message>
        <source>Height over the mean plane</source>
        <translation>Höhe über der Ebene</translation>
    </message>
    <message>
        <source>Depth Z</source>
        <translation>Tiefe Z</translation>
    </message>
    <message>
        <source>σ of Z</source>
        <translation>σ von Z</translation>
    </message>
    <message>
        <source>Points in space</source>
        <translation>Punkte im Raum</translation>
    </message>
    <message>
        <source>All cameras: depth Z</source>
        <translation>Alle Kameras: Tiefe Z</translation>
    </message>
    <message>
        <source>All cameras: by camera</source>
        <translation>Alle Kameras: nach Kamera</translation>
    </message>
    <message>
        <source>All cameras: by how they are seen</source>
        <translation>Alle Kameras: wie sie gesehen werden</translation>
    </message>
    <message>
        <source>All cameras: σ of Z</source>
        <translation>Alle Kameras: σ von Z</translation>
    </message>
    <message>
        <source>dark {low:g} to bright {high:g} mm, median {median:.4g} mm</source>
        <translation>dunkel {low:g} bis hell {high:g} mm, Median {median:.4g} mm</translation>
    </message>
    <message>
        <source>by one camera</source>
        <translation>von einer Kamera</translation>
    </message>
    <message>
        <source>by several</source>
        <translation>von mehreren</translation>
    </message>
    <message>
        <source>hidden from others</source>
        <translation>vor anderen verdeckt</translation>
    </message>
    <message>
        <source>rays disagree</source>
        <translation>Strahlen widersprechen sich</translation>
    </message>
    <message>
        <source>by texture</source>
        <translation>nach der Textur</translation>
    </message>
</context>
<context>
    <name>ReconstructPage</name>
    <message>
        <source>Reconstruct</source>
        <translation>Rekonstruieren</translation>
    </message>
    <message>
        <source>From projector coordinates to points in the camera&apos;s frame, each with its sigma.</source>
        <translation>Von Projektorkoordinaten zu Punkten im Kamerasystem, jeder mit seinem σ.</translation>
    </message>
    <message>
        <source>Calibration</source>
        <translation>Kalibrierung</translation>
    </message>
    <message>
        <source>Map of the points</source>
        <translation>Karte der Punkte</translation>
    </message>
    <message>
        <source>Export points…</source>
        <translation>Punkte ausgeben …</translation>
    </message>
    <message>
        <source>Write the points as PLY, XYZ or NPZ.</source>
        <translation>Die Punkte als PLY, XYZ oder NPZ schreiben.</translation>
    </message>
    <message>
        <source>Merge captures…</source>
        <translation>Aufnahmen verbinden …</translation>
    </message>
    <message>
        <source>Join captures of one object from several stations to one cloud.</source>
        <translation>Aufnahmen eines Objekts von mehreren Standpunkten zu einer Punktwolke verbinden.</translation>
    </message>
    <message>
        <source>Reconstruct the chosen capture (F5).</source>
        <translation>Die gewählte Aufnahme rekonstruieren (F5).</translation>
    </message>
    <message>
        <source>Texture too</source>
        <translation>Auch Textur</translation>
    </message>
    <message>
        <source>Where the code fails, match the texture that two cameras see.</source>
        <translation>Wo der Code versagt, die Textur zuordnen, die zwei Kameras sehen.</translation>
    </message>
    <message>
        <source>Point clouds (*.ply *.xyz *.npz)</source>
        <translation>Punktwolken (*.ply *.xyz *.npz)</translation>
    </message>
    <message>
        <source>Export points</source>
        <translation>Punkte ausgeben</translation>
    </message>
    <message>
        <source>{n} points written to {path}.</source>
        <translation>{n} Punkte nach {path} geschrieben.</translation>
    </message>
    <message>
        <source>Merge captures</source>
        <translation>Aufnahmen verbinden</translation>
    </message>
    <message>
        <source>Captures of one object. The points come in the frame of the first one&apos;s camera.</source>
        <translation>Aufnahmen eines Objekts. Die Punkte stehen im System der Kamera der ersten.</translation>
    </message>
    <message>
        <source>{n} captures, poses to {sigma:.3f} mm.</source>
        <translation>{n} Aufnahmen, Posen auf {sigma:.3f} mm.</translation>
    </message>
    <message>
        <source>Calibrate first.</source>
        <translation>Zuerst kalibrieren.</translation>
    </message>
    <message>
        <source>intersecting the rays of all cameras …</source>
        <translation>die Strahlen aller Kameras werden geschnitten …</translation>
    </message>
    <message>
        <source>{n} points.</source>
        <translation>{n} Punkte.</translation>
    </message>
    <message>
        <source>points</source>
        <translation>Punkte</translation>
    </message>
    <message>
        <source>{name} is not reconstructed yet.</source>
        <translation>{name} ist noch nicht rekonstruiert.</translation>
    </message>
    <message>
        <source>   Out of date: reconstruct it again.</source>
        <translation>   Veraltet: neu rekonstruieren.</translation>
    </message>
    <message>
        <source>Of the object {by_code:.1%} by code, {filled:.1%} with texture.</source>
        <translation>Vom Objekt {by_code:.1%} durch Code, {filled:.1%} mit Textur.</translation>
    </message>
    <message>
        <source>Reconstructed: {name}.</source>
        <translation>Rekonstruiert: {name}.</translation>
    </message>
    <message>
        <source>{n} points, {p:.1%} of the image.</source>
        <translation>{n} Punkte, {p:.1%} des Bildes.</translation>
    </message>
    <message>
        <source>Points in space</source>
        <translation>Punkte im Raum</translation>
    </message>
</context>
<context>
    <name>ReportPage</name>
    <message>
        <source>Report</source>
        <translation>Bericht</translation>
    </message>
    <message>
        <source>All tables and figures in one HTML file and one PDF, ready to sign off.</source>
        <translation>Alle Tabellen und Bilder in einer HTML-Datei und einem PDF, fertig zur Unterschrift.</translation>
    </message>
    <message>
        <source>Choose a folder for the ticked files.</source>
        <translation>Einen Ordner für die angekreuzten Dateien wählen.</translation>
    </message>
    <message>
        <source>Write report</source>
        <translation>Bericht schreiben</translation>
    </message>
    <message>
        <source>Files</source>
        <translation>Dateien</translation>
    </message>
    <message>
        <source>Open HTML</source>
        <translation>HTML öffnen</translation>
    </message>
    <message>
        <source>Open PDF</source>
        <translation>PDF öffnen</translation>
    </message>
    <message>
        <source>Export…</source>
        <translation>Ausgeben …</translation>
    </message>
    <message>
        <source>Sign if a name is given, and write HTML and PDF (F5).</source>
        <translation>Freigeben, wenn ein Name dasteht, und HTML und PDF schreiben (F5).</translation>
    </message>
    <message>
        <source>What it says</source>
        <translation>Was darin steht</translation>
    </message>
    <message>
        <source>Report: HTML and PDF</source>
        <translation>Bericht: HTML und PDF</translation>
    </message>
    <message>
        <source>All tables as CSV</source>
        <translation>Alle Tabellen als CSV</translation>
    </message>
    <message>
        <source>Profiles along the line as CSV</source>
        <translation>Profile längs der Linie als CSV</translation>
    </message>
    <message>
        <source>Deviations of every pixel as CSV</source>
        <translation>Abweichungen jedes Pixels als CSV</translation>
    </message>
    <message>
        <source>Export the report into a folder</source>
        <translation>Den Bericht in einen Ordner ausgeben</translation>
    </message>
    <message>
        <source>{n} files written to {folder}.</source>
        <translation>{n} Dateien nach {folder} geschrieben.</translation>
    </message>
    <message>
        <source>Not written yet.</source>
        <translation>Noch nicht geschrieben.</translation>
    </message>
    <message>
        <source>Written {when} in {folder}.</source>
        <translation>Geschrieben {when} in {folder}.</translation>
    </message>
    <message>
        <source>Out of date: {reason}.</source>
        <translation>Veraltet: {reason}.</translation>
    </message>
    <message>
        <source>There are no results yet.</source>
        <translation>Es gibt noch keine Ergebnisse.</translation>
    </message>
    <message>
        <source>The report is written: HTML and PDF.</source>
        <translation>Der Bericht ist geschrieben: HTML und PDF.</translation>
    </message>
</context>
<context>
    <name>ResidualPlot</name>
    <message>
        <source>{n} points; vectors drawn {f:g} times; r.m.s. {x:.2f} µm in x, {y:.2f} µm in y</source>
        <translation>{n} Punkte; Vektoren {f:g}-fach; r.m.s. {x:.2f} µm in x, {y:.2f} µm in y</translation>
    </message>
</context>
<context>
    <name>ResidualView</name>
    <message>
        <source>Captures whose residuals are shown</source>
        <translation>Aufnahmen, deren Verbesserungen gezeigt werden</translation>
    </message>
    <message>
        <source>Click a vector to learn which point it is.</source>
        <translation>Auf einen Vektor klicken, um den Punkt zu erfahren.</translation>
    </message>
    <message>
        <source>Open image</source>
        <translation>Zum Bild</translation>
    </message>
    <message>
        <source>Look at this target in its image.</source>
        <translation>Diese Marke in ihrem Bild ansehen.</translation>
    </message>
    <message>
        <source>Exclude target</source>
        <translation>Marke ausschließen</translation>
    </message>
    <message>
        <source>Leave this target of this capture out, and calibrate again.</source>
        <translation>Diese Marke dieser Aufnahme weglassen und neu kalibrieren.</translation>
    </message>
    <message>
        <source>Leave out capture</source>
        <translation>Aufnahme weglassen</translation>
    </message>
    <message>
        <source>Calibrate again without this capture.</source>
        <translation>Ohne diese Aufnahme neu kalibrieren.</translation>
    </message>
    <message>
        <source>Captures</source>
        <translation>Aufnahmen</translation>
    </message>
    <message>
        <source>Residual vectors of {name}</source>
        <translation>Verbesserungen von {name}</translation>
    </message>
    <message>
        <source>all</source>
        <translation>alle</translation>
    </message>
</context>
<context>
    <name>Rig</name>
    <message>
        <source>camera</source>
        <translation>Kamera</translation>
    </message>
    <message>
        <source>projector</source>
        <translation>Projektor</translation>
    </message>
    <message>
        <source>{mm:.1f} mm</source>
        <translation>{mm:.1f} mm</translation>
    </message>
    <message>
        <source>device</source>
        <translation>Gerät</translation>
    </message>
    <message>
        <source>axis turned by [°]</source>
        <translation>Achse gedreht um [°]</translation>
    </message>
    <message>
        <source>sees across [mm]</source>
        <translation>sieht in der Breite [mm]</translation>
    </message>
    <message>
        <source>and down [mm]</source>
        <translation>in der Höhe [mm]</translation>
    </message>
    <message>
        <source>one pixel or line [mm]</source>
        <translation>ein Pixel oder eine Linie [mm]</translation>
    </message>
    <message>
        <source>At {mid:.0f} mm, the middle of the calibrated distances from {near:.0f} to {far:.0f} mm.</source>
        <translation>Bei {mid:.0f} mm, der Mitte der kalibrierten Entfernungen von {near:.0f} bis {far:.0f} mm.</translation>
    </message>
    <message>
        <source>turned about X [µrad]</source>
        <translation>gedreht um X [µrad]</translation>
    </message>
    <message>
        <source>about Y [µrad]</source>
        <translation>um Y [µrad]</translation>
    </message>
    <message>
        <source>about Z [µrad]</source>
        <translation>um Z [µrad]</translation>
    </message>
    <message>
        <source>shifted across the base [µm]</source>
        <translation>quer zur Basis [µm]</translation>
    </message>
    <message>
        <source>and square to both [µm]</source>
        <translation>und senkrecht zu beiden [µm]</translation>
    </message>
    <message>
        <source>±{s:g} σ: out of control beyond</source>
        <translation>±{s:g} σ: darüber außer Kontrolle</translation>
    </message>
    <message>
        <source>±{s:g} σ: warning beyond</source>
        <translation>±{s:g} σ: darüber Warnung</translation>
    </message>
    <message>
        <source>in control</source>
        <translation>in Ordnung</translation>
    </message>
    <message>
        <source>warning</source>
        <translation>Warnung</translation>
    </message>
    <message>
        <source>OUT OF CONTROL</source>
        <translation>AUSSER KONTROLLE</translation>
    </message>
    <message>
        <source>capture</source>
        <translation>Aufnahme</translation>
    </message>
    <message>
        <source>rig</source>
        <translation>Aufbau</translation>
    </message>
</context>
<context>
    <name>RigPage</name>
    <message>
        <source>Rig</source>
        <translation>Aufbau</translation>
    </message>
    <message>
        <source>Where the devices stand, and whether they have stayed there.</source>
        <translation>Wo die Geräte stehen, und ob sie dort geblieben sind.</translation>
    </message>
    <message>
        <source>The rig in space</source>
        <translation>Der Aufbau im Raum</translation>
    </message>
    <message>
        <source>Devices of the rig</source>
        <translation>Geräte des Aufbaus</translation>
    </message>
    <message>
        <source>Each device looks out of its tinted image; green: what all of them see; grey: the targets of all poses.</source>
        <translation>Jedes Gerät blickt durch sein getöntes Bild; grün: was alle sehen; grau: die Marken aller Lagen.</translation>
    </message>
    <message>
        <source>In space</source>
        <translation>Im Raum</translation>
    </message>
    <message>
        <source>Drift chart</source>
        <translation>Driftkarte</translation>
    </message>
    <message>
        <source>capture</source>
        <translation>Aufnahme</translation>
    </message>
    <message>
        <source>off what was expected [σ]</source>
        <translation>neben dem Erwarteten [σ]</translation>
    </message>
    <message>
        <source>Captures of the drift chart</source>
        <translation>Aufnahmen der Driftkarte</translation>
    </message>
    <message>
        <source>Camera and projector</source>
        <translation>Kamera und Projektor</translation>
    </message>
    <message>
        <source>Look at all captures</source>
        <translation>Alle Aufnahmen ansehen</translation>
    </message>
    <message>
        <source>Drift</source>
        <translation>Drift</translation>
    </message>
    <message>
        <source>Calibrate by the photogrammetric method first.</source>
        <translation>Zuerst photogrammetrisch kalibrieren.</translation>
    </message>
    <message>
        <source>No capture shows both projector coordinates of enough pixels.</source>
        <translation>Keine Aufnahme zeigt beide Projektorkoordinaten von genügend Pixeln.</translation>
    </message>
    <message>
        <source>Every capture tells whether the projector has moved against the camera.</source>
        <translation>Jede Aufnahme sagt, ob sich der Projektor gegen die Kamera bewegt hat.</translation>
    </message>
    <message>
        <source>Out of control: {names}.</source>
        <translation>Außer Kontrolle: {names}.</translation>
    </message>
    <message>
        <source>In control: {n} captures, none off what was expected.</source>
        <translation>In Ordnung: {n} Aufnahmen, keine neben dem Erwarteten.</translation>
    </message>
</context>
<context>
    <name>RigStep</name>
    <message>
        <source>Width</source>
        <translation>Breite</translation>
    </message>
    <message>
        <source>Height</source>
        <translation>Höhe</translation>
    </message>
    <message>
        <source>Pitch across</source>
        <translation>Pixelabstand quer</translation>
    </message>
    <message>
        <source>Pitch down</source>
        <translation>Pixelabstand hoch</translation>
    </message>
    <message>
        <source>Focal length</source>
        <translation>Brennweite</translation>
    </message>
    <message>
        <source>Rig to start from</source>
        <translation>Aufbau als Vorlage</translation>
    </message>
    <message>
        <source>Custom</source>
        <translation>Eigener</translation>
    </message>
    <message>
        <source>Camera</source>
        <translation>Kamera</translation>
    </message>
    <message>
        <source>px</source>
        <translation>px</translation>
    </message>
    <message>
        <source>Projector</source>
        <translation>Projektor</translation>
    </message>
    <message>
        <source>lines</source>
        <translation>Linien</translation>
    </message>
    <message>
        <source>Working distance</source>
        <translation>Arbeitsabstand</translation>
    </message>
    <message>
        <source>Base</source>
        <translation>Basis</translation>
    </message>
    <message>
        <source>For the sketch and the advice only; calibration finds the true orientation.</source>
        <translation>Nur für Skizze und Ratschläge; die wahre Orientierung findet die Kalibrierung.</translation>
    </message>
    <message>
        <source>Sketch of the rig</source>
        <translation>Skizze des Aufbaus</translation>
    </message>
    <message>
        <source>(sketch only)</source>
        <translation>(nur Skizze)</translation>
    </message>
    <message>
        <source>On the object: 1 px = {px:.3f} mm, 1 line = {line:.3f} mm.</source>
        <translation>Auf dem Objekt: 1 px = {px:.3f} mm, 1 Linie = {line:.3f} mm.</translation>
    </message>
    <message>
        <source>Axes meet at {angle:.1f}°: 1 line = {depth:.2f} mm in depth.</source>
        <translation>Achsen schneiden sich unter {angle:.1f}°: 1 Linie = {depth:.2f} mm in der Tiefe.</translation>
    </message>
</context>
<context>
    <name>RunPart</name>
    <message>
        <source>Cancel</source>
        <translation>Abbrechen</translation>
    </message>
    <message>
        <source>Progress of the calibration</source>
        <translation>Fortschritt der Kalibrierung</translation>
    </message>
    <message>
        <source>Not started yet. The window stays usable while it runs.</source>
        <translation>Noch nicht begonnen. Das Fenster bleibt währenddessen benutzbar.</translation>
    </message>
    <message>
        <source>Stopping…</source>
        <translation>Hält an …</translation>
    </message>
    <message>
        <source>Waiting…</source>
        <translation>Wartet …</translation>
    </message>
    <message>
        <source>Cancelled; the project is as it was.</source>
        <translation>Abgebrochen; das Projekt ist, wie es war.</translation>
    </message>
    <message>
        <source>Failed: {what}. {remedy}.</source>
        <translation>Gescheitert: {what}. {remedy}.</translation>
    </message>
    <message>
        <source>Done; the run is kept.</source>
        <translation>Fertig; der Lauf ist aufbewahrt.</translation>
    </message>
</context>
<context>
    <name>Runs</name>
    <message>
        <source>run {n}</source>
        <translation>Lauf {n}</translation>
    </message>
    <message>
        <source>rigid rig</source>
        <translation>starrer Aufbau</translation>
    </message>
    <message>
        <source>free stations</source>
        <translation>freie Standpunkte</translation>
    </message>
    <message>
        <source>held: {names}</source>
        <translation>festgehalten: {names}</translation>
    </message>
    <message>
        <source>gross errors kept</source>
        <translation>grobe Fehler behalten</translation>
    </message>
    <message>
        <source>rejected beyond {s:g} σ</source>
        <translation>verworfen über {s:g} σ</translation>
    </message>
    <message>
        <source>degree {n}</source>
        <translation>Grad {n}</translation>
    </message>
    <message>
        <source>depth table</source>
        <translation>Tiefentabelle</translation>
    </message>
    <message>
        <source>low-pass {s:g} px</source>
        <translation>Tiefpass {s:g} px</translation>
    </message>
    <message>
        <source>without {names}</source>
        <translation>ohne {names}</translation>
    </message>
    <message>
        <source>run</source>
        <translation>Lauf</translation>
    </message>
    <message>
        <source>name</source>
        <translation>Name</translation>
    </message>
    <message>
        <source>in use</source>
        <translation>verwendet</translation>
    </message>
    <message>
        <source>camera [µm]</source>
        <translation>Kamera [µm]</translation>
    </message>
    <message>
        <source>projector [µm]</source>
        <translation>Projektor [µm]</translation>
    </message>
    <message>
        <source>points [µm]</source>
        <translation>Punkte [µm]</translation>
    </message>
    <message>
        <source>depth [mm]</source>
        <translation>Tiefe [mm]</translation>
    </message>
    <message>
        <source>captures</source>
        <translation>Aufnahmen</translation>
    </message>
    <message>
        <source>left out</source>
        <translation>weggelassen</translation>
    </message>
    <message>
        <source>options</source>
        <translation>Einstellungen</translation>
    </message>
    <message>
        <source>made</source>
        <translation>entstanden</translation>
    </message>
    <message>
        <source>all of it</source>
        <translation>ganz</translation>
    </message>
    <message>
        <source>parameter</source>
        <translation>Parameter</translation>
    </message>
    <message>
        <source>difference</source>
        <translation>Unterschied</translation>
    </message>
    <message>
        <source>in σ</source>
        <translation>in σ</translation>
    </message>
    <message>
        <source>In σ: the difference over the greater of both sigmas. The runs share observations, so this is no test; it says what the change was worth. ▲ marks differences above one sigma.</source>
        <translation>In σ: der Unterschied, geteilt durch das größere der beiden σ. Die Läufe haben Beobachtungen gemeinsam, es ist also kein Test; es sagt, was die Änderung ausmacht. ▲ markiert Unterschiede über einem σ.</translation>
    </message>
    <message>
        <source>{second} against {first}</source>
        <translation>{second} gegen {first}</translation>
    </message>
    <message>
        <source>held</source>
        <translation>fest</translation>
    </message>
</context>
<context>
    <name>RunsPart</name>
    <message>
        <source>Kept runs</source>
        <translation>Aufbewahrte Läufe</translation>
    </message>
    <message>
        <source>a name for the chosen run</source>
        <translation>ein Name für den gewählten Lauf</translation>
    </message>
    <message>
        <source>Name of the chosen run</source>
        <translation>Name des gewählten Laufs</translation>
    </message>
    <message>
        <source>Name it</source>
        <translation>Benennen</translation>
    </message>
    <message>
        <source>Use this run</source>
        <translation>Diesen Lauf verwenden</translation>
    </message>
    <message>
        <source>Put its calibrations in use; what follows is then out of date.</source>
        <translation>Seine Kalibrierungen verwenden; was darauf folgt, ist dann veraltet.</translation>
    </message>
    <message>
        <source>Delete</source>
        <translation>Löschen</translation>
    </message>
    <message>
        <source>Delete the chosen run from the disk.</source>
        <translation>Den gewählten Lauf von der Platte löschen.</translation>
    </message>
    <message>
        <source>Run to compare with</source>
        <translation>Lauf, mit dem verglichen wird</translation>
    </message>
    <message>
        <source>Run to compare</source>
        <translation>Zu vergleichender Lauf</translation>
    </message>
    <message>
        <source>Comparison of two runs</source>
        <translation>Vergleich zweier Läufe</translation>
    </message>
    <message>
        <source>Difference of two runs over the working volume</source>
        <translation>Unterschied zweier Läufe über den Arbeitsraum</translation>
    </message>
    <message>
        <source>Parameters</source>
        <translation>Parameter</translation>
    </message>
    <message>
        <source>Working volume</source>
        <translation>Arbeitsraum</translation>
    </message>
    <message>
        <source>Compare</source>
        <translation>Vergleiche</translation>
    </message>
    <message>
        <source>with</source>
        <translation>mit</translation>
    </message>
    <message>
        <source>{run} and its files are deleted for good.</source>
        <translation>{run} und seine Dateien werden endgültig gelöscht.</translation>
    </message>
    <message>
        <source>Delete a run</source>
        <translation>Einen Lauf löschen</translation>
    </message>
    <message>
        <source>Keep</source>
        <translation>Behalten</translation>
    </message>
    <message>
        <source>Runs are compared here once there are two of them.</source>
        <translation>Läufe werden hier verglichen, sobald es zwei davon gibt.</translation>
    </message>
    <message>
        <source>Choose two different runs.</source>
        <translation>Zwei verschiedene Läufe wählen.</translation>
    </message>
    <message>
        <source>Only photogrammetric calibrations can be compared.</source>
        <translation>Nur photogrammetrische Kalibrierungen lassen sich vergleichen.</translation>
    </message>
</context>
<context>
    <name>ScaleStep</name>
    <message>
        <source>A distance on the board was measured</source>
        <translation>Eine Strecke auf der Tafel ist gemessen</translation>
    </message>
    <message>
        <source>Measured length</source>
        <translation>Gemessene Länge</translation>
    </message>
    <message>
        <source>not typed yet</source>
        <translation>noch nicht eingegeben</translation>
    </message>
    <message>
        <source>Standard deviation</source>
        <translation>Standardabweichung</translation>
    </message>
    <message>
        <source>From row, column</source>
        <translation>Von Zeile, Spalte</translation>
    </message>
    <message>
        <source>to row, column</source>
        <translation>bis Zeile, Spalte</translation>
    </message>
    <message>
        <source>One distance between two targets, measured with a calliper or a scale bar, gives the calibration its scale. Without it the nominal coordinates do, and a print is seldom true to a thousandth.</source>
        <translation>Eine Strecke zwischen zwei Marken, mit Messschieber oder Maßstab gemessen, gibt der Kalibrierung ihren Maßstab. Ohne sie tun es die Nennkoordinaten, und ein Druck ist selten auf ein Tausendstel genau.</translation>
    </message>
    <message>
        <source>From row</source>
        <translation>Von Zeile</translation>
    </message>
    <message>
        <source>From column</source>
        <translation>Von Spalte</translation>
    </message>
    <message>
        <source>To row</source>
        <translation>Bis Zeile</translation>
    </message>
    <message>
        <source>To column</source>
        <translation>Bis Spalte</translation>
    </message>
</context>
<context>
    <name>Sequence</name>
    <message>
        <source>Axes</source>
        <translation>Achsen</translation>
    </message>
    <message>
        <source>White and black frame</source>
        <translation>Weißes und schwarzes Bild</translation>
    </message>
    <message>
        <source>Period [lines]</source>
        <translation>Periode [Linien]</translation>
    </message>
    <message>
        <source>Periods [lines]</source>
        <translation>Perioden [Linien]</translation>
    </message>
    <message>
        <source>Phase steps</source>
        <translation>Phasenschritte</translation>
    </message>
    <message>
        <source>Cell of the code [lines]</source>
        <translation>Zelle des Codes [Linien]</translation>
    </message>
    <message>
        <source>Code</source>
        <translation>Code</translation>
    </message>
    <message>
        <source>Profile</source>
        <translation>Profil</translation>
    </message>
    <message>
        <source>Inverse frames</source>
        <translation>Inverse Bilder</translation>
    </message>
    <message>
        <source>Frames</source>
        <translation>Bilder</translation>
    </message>
    <message>
        <source>Blur [lines]</source>
        <translation>Unschärfe [Linien]</translation>
    </message>
    <message>
        <source>Seed</source>
        <translation>Startwert</translation>
    </message>
    <message>
        <source>sequence</source>
        <translation>Folge</translation>
    </message>
    <message>
        <source>Chosen once the projector answers: the sequence it is made for, else sine fringes if it can show grey.</source>
        <translation>Gewählt, sobald der Projektor antwortet: die Folge, für die er gemacht ist, sonst Sinusstreifen, wenn er Grau zeigen kann.</translation>
    </message>
    <message>
        <source>{n} patterns.</source>
        <translation>{n} Muster.</translation>
    </message>
    <message>
        <source>{n} images, about {s:.0f} s at {ms:.0f} ms an image.</source>
        <translation>{n} Bilder, etwa {s:.0f} s bei {ms:.0f} ms je Bild.</translation>
    </message>
    <message>
        <source>Black and white only: any projector of this size can show it.</source>
        <translation>Nur Schwarz und Weiß: Jeder Projektor dieser Größe kann sie zeigen.</translation>
    </message>
    <message>
        <source>It has levels of grey: a projector of black and white cannot show it.</source>
        <translation>Sie hat Graustufen: Ein Projektor, der nur Schwarz und Weiß kann, kann sie nicht zeigen.</translation>
    </message>
    <message>
        <source>This projector cannot show {n} of {of} patterns, such as “{pattern}”: {why}.</source>
        <translation>Dieser Projektor kann {n} von {of} Mustern nicht zeigen, etwa „{pattern}“: {why}.</translation>
    </message>
    <message>
        <source>This projector can show it.</source>
        <translation>Dieser Projektor kann sie zeigen.</translation>
    </message>
    <message>
        <source>the projector&apos;s own</source>
        <translation>die des Projektors</translation>
    </message>
    <message>
        <source>a list of {n} patterns</source>
        <translation>eine Liste von {n} Mustern</translation>
    </message>
</context>
<context>
    <name>SequenceForm</name>
    <message>
        <source>Sequence</source>
        <translation>Folge</translation>
    </message>
    <message>
        <source>A list of patterns from a file</source>
        <translation>Eine Liste von Mustern aus einer Datei</translation>
    </message>
    <message>
        <source>File of patterns</source>
        <translation>Datei der Muster</translation>
    </message>
    <message>
        <source>a JSON list of patterns, a capture.json or a project.json</source>
        <translation>eine JSON-Liste von Mustern, eine capture.json oder eine project.json</translation>
    </message>
    <message>
        <source>Choose…</source>
        <translation>Wählen …</translation>
    </message>
    <message>
        <source>Choose the file of patterns</source>
        <translation>Die Datei der Muster wählen</translation>
    </message>
    <message>
        <source>Patterns of the sequence</source>
        <translation>Muster der Folge</translation>
    </message>
    <message>
        <source>Choose the file of patterns.</source>
        <translation>Die Datei der Muster wählen.</translation>
    </message>
    <message>
        <source>working out the sequence …</source>
        <translation>Die Folge wird berechnet …</translation>
    </message>
    <message>
        <source>automatic</source>
        <translation>automatisch</translation>
    </message>
    <message>
        <source>Choose a file of patterns</source>
        <translation>Eine Datei der Muster wählen</translation>
    </message>
</context>
<context>
    <name>SheetView</name>
    <message>
        <source>Picture of the board</source>
        <translation>Bild der Tafel</translation>
    </message>
</context>
<context>
    <name>SidePanel</name>
    <message>
        <source>Images</source>
        <translation>Bilder</translation>
    </message>
    <message>
        <source>Targets of this image</source>
        <translation>Marken dieses Bildes</translation>
    </message>
    <message>
        <source>Targets</source>
        <translation>Zielmarken</translation>
    </message>
</context>
<context>
    <name>SignOffForm</name>
    <message>
        <source>Judge against a tolerance</source>
        <translation>Gegen eine Toleranz beurteilen</translation>
    </message>
    <message>
        <source>Tolerance</source>
        <translation>Toleranz</translation>
    </message>
    <message>
        <source>Figure that the tolerance limits</source>
        <translation>Größe, die die Toleranz begrenzt</translation>
    </message>
    <message>
        <source>r.m.s. deviation</source>
        <translation>r.m.s.-Abweichung</translation>
    </message>
    <message>
        <source>largest deviation</source>
        <translation>größte Abweichung</translation>
    </message>
    <message>
        <source>Result</source>
        <translation>Ergebnis</translation>
    </message>
    <message>
        <source>Sign-off</source>
        <translation>Freigabe</translation>
    </message>
    <message>
        <source>Operator</source>
        <translation>Bediener</translation>
    </message>
    <message>
        <source>Instrument</source>
        <translation>Messgerät</translation>
    </message>
    <message>
        <source>Date</source>
        <translation>Datum</translation>
    </message>
    <message>
        <source>Remark</source>
        <translation>Bemerkung</translation>
    </message>
    <message>
        <source>Reason</source>
        <translation>Grund</translation>
    </message>
    <message>
        <source>why it is signed all the same</source>
        <translation>warum dennoch freigegeben wird</translation>
    </message>
    <message>
        <source>without a name: not signed</source>
        <translation>ohne Namen: keine Freigabe</translation>
    </message>
    <message>
        <source>Failed: {what}. It can be signed with a reason only.</source>
        <translation>Nicht bestanden: {what}. Nur mit einem Grund kann freigegeben werden.</translation>
    </message>
</context>
<context>
    <name>SpaceView</name>
    <message>
        <source>Drag to turn, wheel to come closer, Ctrl and drag to move.</source>
        <translation>Ziehen dreht, das Rad holt näher, Strg und Ziehen verschiebt.</translation>
    </message>
    <message>
        <source>From the camera</source>
        <translation>Von der Kamera</translation>
    </message>
    <message>
        <source>From beside</source>
        <translation>Von der Seite</translation>
    </message>
</context>
<context>
    <name>StageStrip</name>
    <message>
        <source>Stages</source>
        <translation>Schritte</translation>
    </message>
</context>
<context>
    <name>Stages</name>
    <message>
        <source>Capture</source>
        <translation>Aufnehmen</translation>
    </message>
    <message>
        <source>Decode</source>
        <translation>Dekodieren</translation>
    </message>
    <message>
        <source>Measure</source>
        <translation>Messen</translation>
    </message>
    <message>
        <source>Calibrate</source>
        <translation>Kalibrieren</translation>
    </message>
    <message>
        <source>Reconstruct</source>
        <translation>Rekonstruieren</translation>
    </message>
    <message>
        <source>Evaluate</source>
        <translation>Beurteilen</translation>
    </message>
    <message>
        <source>Report</source>
        <translation>Bericht</translation>
    </message>
    <message>
        <source>done</source>
        <translation>fertig</translation>
    </message>
    <message>
        <source>out of date</source>
        <translation>veraltet</translation>
    </message>
    <message>
        <source>to do</source>
        <translation>offen</translation>
    </message>
    <message>
        <source>failed</source>
        <translation>gescheitert</translation>
    </message>
    <message>
        <source>and {n} more</source>
        <translation>und {n} weitere</translation>
    </message>
    <message>
        <source>points of {n} captures</source>
        <translation>Punkte von {n} Aufnahmen</translation>
    </message>
    <message>
        <source>no captures yet</source>
        <translation>noch keine Aufnahmen</translation>
    </message>
    <message>
        <source>{n} captures</source>
        <translation>{n} Aufnahmen</translation>
    </message>
    <message>
        <source>{n} captures decoded</source>
        <translation>{n} Aufnahmen dekodiert</translation>
    </message>
    <message>
        <source>targets of {n} captures</source>
        <translation>Marken von {n} Aufnahmen</translation>
    </message>
    <message>
        <source>{n} planes</source>
        <translation>{n} Ebenen</translation>
    </message>
    <message>
        <source>HTML and PDF</source>
        <translation>HTML und PDF</translation>
    </message>
    <message>
        <source>Camera</source>
        <translation>Kamera</translation>
    </message>
    <message>
        <source>Projector</source>
        <translation>Projektor</translation>
    </message>
</context>
<context>
    <name>Start</name>
    <message>
        <source>not there any more</source>
        <extracomment>how many captures it has and when something was last written</extracomment>
        <translation>nicht mehr da</translation>
    </message>
    <message>
        <source>damaged</source>
        <translation>beschädigt</translation>
    </message>
    <message>
        <source>1 capture</source>
        <translation>1 Aufnahme</translation>
    </message>
    <message>
        <source>{n} captures</source>
        <translation>{n} Aufnahmen</translation>
    </message>
</context>
<context>
    <name>StartPage</name>
    <message>
        <source>Stripe workbench</source>
        <translation>Streifenprojektion</translation>
    </message>
    <message>
        <source>From captured stripes to a plane-table report.</source>
        <translation>Von aufgenommenen Streifen zum Prüfbericht an der Planplatte.</translation>
    </message>
    <message>
        <source>Recent projects</source>
        <translation>Letzte Projekte</translation>
    </message>
    <message>
        <source>Projects you open are listed here. Without a rig, begin with the demo experiment.</source>
        <translation>Geöffnete Projekte stehen hier. Ohne Aufbau mit dem Vorführversuch beginnen.</translation>
    </message>
    <message>
        <source>A project folder can also be dropped onto this window.</source>
        <translation>Ein Projektordner lässt sich auch auf dieses Fenster ziehen.</translation>
    </message>
    <message>
        <source>Enter opens a project, Delete takes it off the list.</source>
        <translation>Eingabe öffnet ein Projekt, Entf nimmt es von der Liste.</translation>
    </message>
</context>
<context>
    <name>Studies</name>
    <message>
        <source>capture</source>
        <translation>Aufnahme</translation>
    </message>
    <message>
        <source>lines</source>
        <translation>Linien</translation>
    </message>
    <message>
        <source>with it</source>
        <translation>mit ihr</translation>
    </message>
    <message>
        <source>limit</source>
        <translation>Grenzwert</translation>
    </message>
    <message>
        <source>changes most</source>
        <translation>ändert sich am meisten</translation>
    </message>
    <message>
        <source>in σ</source>
        <translation>in σ</translation>
    </message>
    <message>
        <source>R.m.s. residuals against the calibration without the capture, and with it; F tests whether the capture is like the others. Last, the parameter that would change most without it, in its σ.</source>
        <translation>Verbesserungen (r.m.s.) gegen die Kalibrierung ohne die Aufnahme, und mit ihr; F prüft, ob sie ist wie die anderen. Zuletzt der Parameter, der sich ohne sie am meisten ändern würde, in seinen σ.</translation>
    </message>
    <message>
        <source>pose of the board</source>
        <translation>Stellung der Tafel</translation>
    </message>
    <message>
        <source>all σ [%]</source>
        <translation>alle σ [%]</translation>
    </message>
    <message>
        <source>most of all</source>
        <translation>am meisten</translation>
    </message>
    <message>
        <source>its σ [%]</source>
        <translation>dessen σ [%]</translation>
    </message>
    <message>
        <source>In this order. Tilt and roll as the camera sees the board, from facing it upright. σ: by how much those of all interior and relative orientations would change on average, after the poses above, and the one that would gain most. Calibrate with them before you ask again.</source>
        <translation>In dieser Reihenfolge. Neigung und Verkantung, wie die Kamera die Tafel sieht, aus frontaler, aufrechter Stellung. σ: um wie viel sich die aller inneren und relativen Orientierungen im Mittel nach den Stellungen darüber ändern würden, und der Parameter, der am meisten gewinnt. Erst mit ihnen kalibrieren, dann wieder fragen.</translation>
    </message>
</context>
<context>
    <name>SubjectForm</name>
    <message>
        <source>Position of the plate</source>
        <translation>Stellung der Platte</translation>
    </message>
    <message>
        <source>Angle of the plane-table</source>
        <translation>Winkel der Planplatte</translation>
    </message>
    <message>
        <source>What is it for?</source>
        <translation>Wofür ist sie?</translation>
    </message>
    <message>
        <source>Position</source>
        <translation>Stellung</translation>
    </message>
    <message>
        <source>Angle</source>
        <translation>Winkel</translation>
    </message>
    <message>
        <source>Board</source>
        <translation>Tafel</translation>
    </message>
    <message>
        <source>Name</source>
        <translation>Name</translation>
    </message>
    <message>
        <source>New capture</source>
        <translation>Neue Aufnahme</translation>
    </message>
    <message>
        <source>Open a project.</source>
        <translation>Ein Projekt öffnen.</translation>
    </message>
    <message>
        <source>There is a capture of this name already: choose another.</source>
        <translation>Eine Aufnahme dieses Namens gibt es schon: einen anderen wählen.</translation>
    </message>
</context>
<context>
    <name>SubjectStep</name>
    <message>
        <source>Interrupted captures</source>
        <translation>Unterbrochene Aufnahmen</translation>
    </message>
    <message>
        <source>Go on with an interrupted capture</source>
        <translation>Eine unterbrochene Aufnahme fortsetzen</translation>
    </message>
    <message>
        <source>A capture of this name was interrupted: choose it in the list, or another name.</source>
        <translation>Eine Aufnahme dieses Namens wurde unterbrochen: sie in der Liste wählen, oder einen anderen Namen.</translation>
    </message>
</context>
<context>
    <name>SummaryStep</name>
    <message>
        <source>Name</source>
        <translation>Name</translation>
    </message>
    <message>
        <source>Folder</source>
        <translation>Ordner</translation>
    </message>
    <message>
        <source>Rig</source>
        <translation>Aufbau</translation>
    </message>
    <message>
        <source>Testfield</source>
        <translation>Testfeld</translation>
    </message>
    <message>
        <source>Depth plate</source>
        <translation>Tiefenplatte</translation>
    </message>
    <message>
        <source>Scale</source>
        <translation>Maßstab</translation>
    </message>
    <message>
        <source>Sequence</source>
        <translation>Folge</translation>
    </message>
    <message>
        <source>Will be written</source>
        <translation>Wird geschrieben</translation>
    </message>
    <message>
        <source>none</source>
        <translation>keine</translation>
    </message>
    <message>
        <source>{length:.4f} mm ± {sigma:.4f} mm from row {a}, column {b} to row {c}, column {d}</source>
        <translation>{length:.4f} mm ± {sigma:.4f} mm von Zeile {a}, Spalte {b} bis Zeile {c}, Spalte {d}</translation>
    </message>
    <message>
        <source>from the nominal coordinates of the testfield</source>
        <translation>aus den Nennkoordinaten des Testfelds</translation>
    </message>
</context>
<context>
    <name>TakingStep</name>
    <message>
        <source>Take the sequence</source>
        <translation>Folge aufnehmen</translation>
    </message>
    <message>
        <source>Cancel</source>
        <translation>Abbrechen</translation>
    </message>
    <message>
        <source>Take this frame again</source>
        <translation>Dieses Bild noch einmal</translation>
    </message>
    <message>
        <source>Another like this</source>
        <translation>Noch eine solche</translation>
    </message>
    <message>
        <source>Progress of the capture</source>
        <translation>Fortschritt der Aufnahme</translation>
    </message>
    <message>
        <source>Patterns of the capture</source>
        <translation>Muster der Aufnahme</translation>
    </message>
    <message>
        <source>Frame</source>
        <translation>Bild</translation>
    </message>
    <message>
        <source>What the checks said</source>
        <translation>Was die Prüfungen ergaben</translation>
    </message>
    <message>
        <source>The sequence is being taken.</source>
        <translation>Die Folge wird aufgenommen.</translation>
    </message>
    <message>
        <source>Take the sequence.</source>
        <translation>Die Folge aufnehmen.</translation>
    </message>
    <message>
        <source>Nothing may move from now until the last image.</source>
        <translation>Von jetzt bis zum letzten Bild darf sich nichts bewegen.</translation>
    </message>
    <message>
        <source>Goes on where it stopped: {taken} of {planned} images are there already.</source>
        <translation>Geht weiter, wo sie stehen blieb: {taken} von {planned} Bildern sind schon da.</translation>
    </message>
    <message>
        <source>Frame again</source>
        <translation>Bild noch einmal</translation>
    </message>
    <message>
        <source>Stopping …</source>
        <translation>Hält an …</translation>
    </message>
    <message>
        <source>{taken} of {of} images taken</source>
        <translation>{taken} von {of} Bildern aufgenommen</translation>
    </message>
    <message>
        <source>All images are taken; they are being verified</source>
        <translation>Alle Bilder sind aufgenommen; sie werden geprüft</translation>
    </message>
    <message>
        <source>, about {s:.0f} s left</source>
        <translation>, noch etwa {s:.0f} s</translation>
    </message>
    <message>
        <source>{n} images stored in {s:.1f} s; {r} taken again.</source>
        <translation>{n} Bilder in {s:.1f} s gespeichert; {r} noch einmal aufgenommen.</translation>
    </message>
    <message>
        <source>Stopped. The images that are there stay; take the sequence again to go on with the rest.</source>
        <translation>Angehalten. Die vorhandenen Bilder bleiben; die Folge noch einmal aufnehmen, um mit dem Rest fortzufahren.</translation>
    </message>
    <message>
        <source>Stopped. The capture is as it was.</source>
        <translation>Angehalten. Die Aufnahme ist, wie sie war.</translation>
    </message>
</context>
<context>
    <name>Verdict</name>
    <message>
        <source>Passed</source>
        <translation>Bestanden</translation>
    </message>
    <message>
        <source>Doubtful</source>
        <translation>Zweifelhaft</translation>
    </message>
    <message>
        <source>Failed</source>
        <translation>Nicht bestanden</translation>
    </message>
</context>
<context>
    <name>VerdictList</name>
    <message>
        <source>Verdicts</source>
        <translation>Urteile</translation>
    </message>
</context>
<context>
    <name>Volume</name>
    <message>
        <source>distance [mm]</source>
        <translation>Abstand [mm]</translation>
    </message>
    <message>
        <source>{d:.0f} mm away: {rms:.{n}f} {unit} r.m.s., {most:.{n}f} at most</source>
        <translation>in {d:.0f} mm Abstand: {rms:.{n}f} {unit} r.m.s., höchstens {most:.{n}f}</translation>
    </message>
    <message>
        <source>σ of the projector&apos;s image</source>
        <translation>σ im Bild des Projektors</translation>
    </message>
    <message>
        <source>projector [lines]</source>
        <translation>Projektor [Linien]</translation>
    </message>
    <message>
        <source>σ of points</source>
        <translation>σ der Punkte</translation>
    </message>
    <message>
        <source>points [mm]</source>
        <translation>Punkte [mm]</translation>
    </message>
    <message>
        <source>σ of form</source>
        <translation>σ der Form</translation>
    </message>
    <message>
        <source>σ of the camera&apos;s image</source>
        <translation>σ im Bild der Kamera</translation>
    </message>
    <message>
        <source>camera [px]</source>
        <translation>Kamera [px]</translation>
    </message>
    <message>
        <source>lines</source>
        <translation>Linien</translation>
    </message>
    <message>
        <source>What the calibration&apos;s sigmas mean for points, shapes and images where the camera sees the projector&apos;s light.</source>
        <translation>Was die σ der Kalibrierung für Punkte, Formen und Bilder bedeuten, wo die Kamera das Licht des Projektors sieht.</translation>
    </message>
    <message>
        <source>R.m.s. over the image, without the noise of a capture. Form: after the best movement of all points as one; images: after the best place of the device. They grow where no target was captured.</source>
        <translation>R.m.s. über das Bild, ohne das Rauschen einer Aufnahme. Form: nach der besten Bewegung aller Punkte als Ganzes; Bilder: nach der besten Stellung des Geräts. Sie wachsen, wo keine Marken aufgenommen wurden.</translation>
    </message>
    <message>
        <source>in σ</source>
        <translation>in σ</translation>
    </message>
    <message>
        <source>Difference</source>
        <translation>Unterschied</translation>
    </message>
    <message>
        <source>difference [mm]</source>
        <translation>Unterschied [mm]</translation>
    </message>
    <message>
        <source>Difference in σ</source>
        <translation>Unterschied in σ</translation>
    </message>
    <message>
        <source>Form</source>
        <translation>Form</translation>
    </message>
    <message>
        <source>form [mm]</source>
        <translation>Form [mm]</translation>
    </message>
    <message>
        <source>Form in σ</source>
        <translation>Form in σ</translation>
    </message>
    <message>
        <source>R.m.s. over the image: how far apart both put the same point. Form: what is left of it after the best movement of all points as one.</source>
        <translation>R.m.s. über das Bild: wie weit beide denselben Punkt auseinander legen. Form: was davon nach der besten Bewegung aller Punkte als Ganzes bleibt.</translation>
    </message>
    <message>
        <source>One of them tells no sigmas, so that chance cannot be told from a difference.</source>
        <translation>Eine von beiden gibt keine σ an; Zufall und Unterschied lassen sich also nicht trennen.</translation>
    </message>
    <message>
        <source>They differ by more than chance: χ² {x:.3g} with {n} degrees of freedom, limit {limit:.3g}.</source>
        <translation>Sie unterscheiden sich um mehr als den Zufall: χ² {x:.3g} bei {n} Freiheitsgraden, Grenzwert {limit:.3g}.</translation>
    </message>
    <message>
        <source>They agree within their sigmas: χ² {x:.3g} with {n} degrees of freedom, limit {limit:.3g}.</source>
        <translation>Sie stimmen innerhalb ihrer σ überein: χ² {x:.3g} bei {n} Freiheitsgraden, Grenzwert {limit:.3g}.</translation>
    </message>
    <message>
        <source>Both are taken as independent; runs that share captures differ by less.</source>
        <translation>Beide gelten als unabhängig; Läufe mit gemeinsamen Aufnahmen unterscheiden sich um weniger.</translation>
    </message>
</context>
<context>
    <name>VolumeMaps</name>
    <message>
        <source>Map</source>
        <translation>Karte</translation>
    </message>
    <message>
        <source>Working out…</source>
        <translation>Wird berechnet …</translation>
    </message>
    <message>
        <source>Working volume</source>
        <translation>Arbeitsraum</translation>
    </message>
    <message>
        <source>{what}. {remedy}.</source>
        <translation>{what}. {remedy}.</translation>
    </message>
</context>
<context>
    <name>Wizard</name>
    <message>
        <source>Close</source>
        <translation>Schließen</translation>
    </message>
    <message>
        <source>Back</source>
        <translation>Zurück</translation>
    </message>
    <message>
        <source>Next</source>
        <translation>Weiter</translation>
    </message>
    <message>
        <source>One step back (Alt+Left)</source>
        <translation>Einen Schritt zurück (Alt+Links)</translation>
    </message>
    <message>
        <source>One step on (Alt+Right)</source>
        <translation>Einen Schritt weiter (Alt+Rechts)</translation>
    </message>
</context>
<context>
    <name>Workbench</name>
    <message>
        <source>Work is running in the open project.</source>
        <extracomment>{&quot;info&quot;, &quot;success&quot;, &quot;warning&quot;, &quot;error&quot;}</extracomment>
        <translation>Im offenen Projekt läuft eine Arbeit.</translation>
    </message>
    <message>
        <source>wait until it is done, or cancel it</source>
        <translation>warten, bis sie fertig ist, oder sie abbrechen</translation>
    </message>
    <message>
        <source>Looking at the captures</source>
        <translation>Die Aufnahmen werden angesehen</translation>
    </message>
</context>
<context>
    <name>_Space</name>
    <message>
        <source>The arrow keys turn the view, plus and minus zoom, 0 shows all.</source>
        <translation>Die Pfeiltasten drehen die Ansicht, Plus und Minus vergrößern und verkleinern, 0 zeigt alles.</translation>
    </message>
</context>
</TS>
